// Axis-aligned boxes (m).
#pragma once

#include "sphere.h"

namespace solidcull {

struct Box {
  Vec3 lo = Vec3::Zero(), hi = Vec3::Zero();

  bool holds(const Vec3& x) const { return (x.array() >= lo.array()).all() && (x.array() <= hi.array()).all(); }
  /// Larger by this on each side.
  Box grown_by(double margin) const { return {lo - Vec3::Constant(margin), hi + Vec3::Constant(margin)}; }
  /// Around all that the box passes on a straight way.
  Box swept_along(const Vec3& way) const { return {lo + way.cwiseMin(0.0), hi + way.cwiseMax(0.0)}; }
};

}  // namespace solidcull
