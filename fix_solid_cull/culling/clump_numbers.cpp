#include "clump_numbers.h"

#include <type_traits>

namespace solidcull {
namespace {

/// Calls visit(number) for each number but those of `rest`, in one order.
template <class Visit>
void each_number(Clump& c, Visit visit) {
  visit(c.number);
  visit(c.spheres);
  visit(c.mass);
  for (int d = 0; d < 3; ++d) visit(c.lies.centre[d]);
  for (int k = 0; k < 4; ++k) visit(c.lies.turn.coeffs()[k]);
  for (int d = 0; d < 3; ++d) visit(c.lies.inertia[d]);
  for (int d = 0; d < 3; ++d) visit(c.velocity[d]);
  for (int d = 0; d < 3; ++d) visit(c.angular_momentum[d]);
}

}  // namespace

void pack(const Clump& clump, std::vector<double>& to) {
  Clump c = clump;
  each_number(c, [&](auto& x) { to.push_back(static_cast<double>(x)); });
  to.insert(to.end(), c.rest.begin(), c.rest.end());
}

Clump unpack_clump(const double* from, std::size_t rest_size) {
  Clump c;
  each_number(c, [&](auto& x) { x = static_cast<std::decay_t<decltype(x)>>(*from++); });
  c.rest.assign(from, from + rest_size);
  return c;
}

}  // namespace solidcull
