#include "numbers.h"

#include <cmath>
#include <cstdio>

#include "run_failure.h"

namespace solidcull {

void refuse_no_number(std::int64_t tag, const char* what, const Vec3& value) {
  char numbers[96];
  std::snprintf(numbers, sizeof numbers, "%.4g %.4g %.4g", value[0], value[1], value[2]);
  throw RunFailure("the " + std::string(what) + " of granule " + std::to_string(tag) + " is no number (" + numbers +
                   "): take a smaller timestep, and create no granule inside another");
}

void check_numbers(const Atoms& atoms) {
  for (int i = 0; i < atoms.owned; ++i) {
    const Vec3 x = atoms.place(i), v = atoms.velocity(i), w = atoms.spin(i);
    if (std::isfinite(x.sum()) && std::isfinite(v.sum()) && std::isfinite(w.sum())) continue;
    if (!x.allFinite()) refuse_no_number(atoms.tag[i], "place", x);
    if (!v.allFinite()) refuse_no_number(atoms.tag[i], "velocity", v);
    if (!w.allFinite()) refuse_no_number(atoms.tag[i], "spin", w);
  }
}

}  // namespace solidcull
