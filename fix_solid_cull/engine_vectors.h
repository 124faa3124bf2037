// The engine's arrays of three and the core's vectors.
#pragma once

#include "sphere.h"

namespace solidcull {

inline Vec3 vec(const double* v) { return Vec3(v[0], v[1], v[2]); }

inline void set(double* to, const Vec3& v) {
  for (int d = 0; d < 3; ++d) to[d] = v[d];
}

}  // namespace solidcull
