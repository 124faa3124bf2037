#include <gtest/gtest.h>

#include "box.h"

namespace solidcull {
namespace {

TEST(Box, holds_its_corners_and_what_is_between) {
  const Box box{Vec3(0, 0, 0), Vec3(1, 2, 3)};
  for (const Vec3& x : {Vec3(0, 0, 0), Vec3(1, 2, 3), Vec3(0.5, 1, 1.5)}) EXPECT_TRUE(box.holds(x));
  for (const Vec3& x : {Vec3(-1e-9, 0, 0), Vec3(0, 2 + 1e-9, 0), Vec3(0.5, 1, 4)}) EXPECT_FALSE(box.holds(x));
}

TEST(Box, grows_on_each_side) {
  const Box box = Box{Vec3(0, 0, 0), Vec3(1, 2, 3)}.grown_by(0.5);
  EXPECT_EQ(box.lo, Vec3(-0.5, -0.5, -0.5));
  EXPECT_EQ(box.hi, Vec3(1.5, 2.5, 3.5));
}

TEST(Box, what_it_sweeps_holds_its_corners_all_the_way) {
  const Box face{Vec3(-1, -2, 0), Vec3(1, 2, 0)};  // flat
  for (const Vec3& way : {Vec3(0, 0, 3), Vec3(0, 0, -3), Vec3(1, -2, 0.5), Vec3(0, 0, 0)}) {
    const Box swept = face.swept_along(way);
    for (const double part : {0.0, 0.3, 1.0})
      for (const Vec3& corner : {face.lo, face.hi}) EXPECT_TRUE(swept.grown_by(1e-12).holds(corner + part * way));
    EXPECT_NEAR((swept.hi - swept.lo - (face.hi - face.lo) - way.cwiseAbs()).norm(), 0, 1e-12) << "no larger than need be";
  }
}

}  // namespace
}  // namespace solidcull
