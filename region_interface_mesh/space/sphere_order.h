// An order of spheres that does not depend on who lists them.
#pragma once

#include <tuple>

#include "sphere.h"

namespace solidcull {

inline bool before(const Sphere& a, const Sphere& b) {
  return std::make_tuple(a.centre.x(), a.centre.y(), a.centre.z(), a.radius) <
         std::make_tuple(b.centre.x(), b.centre.y(), b.centre.z(), b.radius);
}

}  // namespace solidcull
