#include <gtest/gtest.h>

#include "audit_tally.h"

namespace solidcull {
namespace {

AuditedPatch patch(double way, double shift, double energy) {
  AuditedPatch p;
  p.granules = 40;
  p.ended = 5;
  p.moved = 40 * way;
  p.energy = 40 * energy;
  p.deep = 10;
  p.load = 10 * 0.2;
  p.load_shift = 10 * shift;
  return p;
}

TEST(AuditTally, patches_that_agree_leave_what_no_patch_can_see) {
  AuditTally t;
  for (int n = 0; n < 6; ++n) t.add({patch(2e-6, 0.01, 3e-9)});
  const Interval way = t.interval(AuditTally::moved), shift = t.interval(AuditTally::load_shift),
                 energy = t.interval(AuditTally::energy);
  EXPECT_NEAR(way.low, 2e-6, 1e-15);
  EXPECT_NEAR(way.high / way.low, 6, 1e-9);
  EXPECT_NEAR(shift.low * shift.high, 1e-4, 1e-9);
  EXPECT_NEAR(energy.low * energy.high, 9e-18, 1e-23);
  EXPECT_EQ(t.all().granules, 240);
}

TEST(AuditTally, patches_that_differ_widen_it) {
  AuditTally alike, unlike;
  for (int n = 0; n < 8; ++n) {
    alike.add({patch(2e-6, 0, 0)});
    unlike.add({patch(n == 0 ? 16e-6 : 0, 0, 0)});  // the same mean
  }
  EXPECT_GT(unlike.interval(AuditTally::moved).high, 1.5 * alike.interval(AuditTally::moved).high);
  EXPECT_EQ(unlike.interval(AuditTally::moved).low, 0) << "what one patch alone saw may be chance";
}

TEST(AuditTally, granules_count_alike_whichever_patch_they_are_in) {
  AuditTally t;
  AuditedPatch small = patch(9e-6, 0, 0);
  small.granules = 1;
  small.moved = 9e-6;
  for (int n = 0; n < 20; ++n) {
    t.add({patch(1e-6, 0, 0)});
    t.add({small});
  }
  const Interval way = t.interval(AuditTally::moved);
  const double mean = (40e-6 + 9e-6) / 41;
  EXPECT_LT(way.low, mean);
  EXPECT_GT(way.high, mean);
  EXPECT_LT(way.high, 6 * 2e-6) << "the mean of the patches' means";
}

TEST(AuditTally, a_few_patches_tell_nothing) {
  AuditTally t;
  EXPECT_EQ(text_of(t, 100, 0.0026), "");
  t.add({AuditedPatch()});
  EXPECT_EQ(t.patches(), 0u) << "nothing slept there";
  for (std::size_t n = 0; n + 1 < AuditTally::fewest; ++n) t.add({patch(2e-6, 0.01, 0)});
  EXPECT_EQ(t.interval(AuditTally::moved).high, 0);
  EXPECT_EQ(text_of(t, 100, 0.0026), "5 patches, 200 granules, 25 of which woke anyway: too few to tell");
}

TEST(AuditTally, loads_that_nobody_could_compare_are_not_told) {
  AuditTally t;
  AuditedPatch p = patch(2.6e-6, 0.01, 3e-9);
  p.deep = p.load = p.load_shift = 0;
  for (int n = 0; n < 6; ++n) t.add({p});
  EXPECT_NE(text_of(t, 100, 0.0026).find("(0.001 to 0.006 d), and have 1e-09"), std::string::npos) << text_of(t, 100, 0.0026);
}

TEST(AuditTally, is_told_in_the_users_units) {
  AuditTally t;
  for (int n = 0; n < 6; ++n) t.add({patch(2.6e-6, 0.01, 3e-9)});
  EXPECT_EQ(text_of(t, 100, 0.0026),
            "6 patches, 240 granules, 30 of which woke anyway; awake, one would go 2.6e-06 to 1.6e-05 m in 100 steps (0.001 to "
            "0.006 d), "
            "shift its loads by 0.0033 to 0.03 N (1.7 to 15 %), and have 1e-09 to 9e-09 J");
}

}  // namespace
}  // namespace solidcull
