#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "world_parts.h"

namespace solidcull {
namespace {

/// A row of eight: four exterior, three interface granules, the last but one stored.
struct Row {
  Row() : world(empty_space()), parts(world, sleeping_settings(), 2 * r) {
    for (int n = 0; n < 8; ++n) world.add(1 + n, Vec3(0.999 * 2 * r * n, 0, 0), r);
    world.reneighbour();
    world.compute_forces();
    parts.meter.begin_run(0);
  }
  void cull() {
    parts.lock({5, 6, 7, 8});
    ++world.run.step;
    parts.put_away({7});
    parts.reneighbour();
    parts.meter.note_new_lists();
  }
  RunWork after(int steps) {
    for (int n = 0; n < steps; ++n) parts.meter.count_step(0);
    return parts.meter.end_run(0.25);
  }
  SmallWorld world;
  WorldParts parts;
};

TEST(WorkMeter, counts_granules_and_listed_pairs_of_each_step) {
  Row row;
  const RunWork w = row.after(10);
  EXPECT_EQ(w.steps, 10);
  EXPECT_EQ(w.exterior, 80);
  EXPECT_EQ(w.interface + w.interior, 0);
  EXPECT_EQ(w.pairs, 70);
  EXPECT_EQ(w.exterior_ends, 140);
}

TEST(WorkMeter, pairs_within_a_body_cost_nothing) {
  Row row;
  row.cull();
  const RunWork w = row.after(10);
  EXPECT_EQ(w.exterior, 40);
  EXPECT_EQ(w.interface, 30);
  EXPECT_EQ(w.interior, 10);
  EXPECT_EQ(w.pairs, 40) << "three among the exterior granules, one with the body";
  EXPECT_EQ(w.exterior_ends, 70);
}

TEST(WorkMeter, seconds_are_those_of_the_run) {
  Row row;
  row.world.run.pair_forces = 0.5;
  row.parts.meter.begin_run(0.125);
  const RunWork w = row.after(1);
  EXPECT_EQ(w.in_fix, 0.125);
  EXPECT_EQ(w.in_pairs, 0.5);
  EXPECT_GT(w.seconds, 0);
}

TEST(WorkMeter, each_run_begins_anew_and_all_are_kept) {
  Row row;
  row.after(10);
  EXPECT_EQ(row.parts.meter.so_far().exterior, 80);
  row.cull();
  const RunWork second = row.after(5);  // as after `run ... pre no`: nothing has begun it
  EXPECT_EQ(second.steps, 5);
  EXPECT_EQ(second.exterior, 20);
  EXPECT_EQ(row.parts.meter.so_far().exterior, 100);
  EXPECT_EQ(row.parts.meter.so_far().interface, 15);
  EXPECT_EQ(row.parts.meter.so_far().interior, 5);
  EXPECT_EQ(row.after(0).steps, 0);
}

TEST(WorkMeter, knows_what_came_back_in_vain_in_this_run) {
  Row row;
  row.cull();
  row.parts.meter.begin_run(0);
  Wakes all;
  all.all = Woke::deck;
  row.parts.change(all, {});
  ++row.world.run.step;
  row.parts.reneighbour();
  row.parts.lock({5, 6});
  const RunWork w = row.after(1);
  EXPECT_EQ(w.restored, 4);
  EXPECT_EQ(w.woken[Woke::deck], 4);
  EXPECT_EQ(w.woken.all(), 4);
  EXPECT_EQ(w.in_vain, 2) << "of four two were culled again, and had not moved";
  row.parts.meter.begin_run(0);
  const RunWork next = row.after(1);
  EXPECT_EQ(next.restored, 0);
  EXPECT_EQ(next.woken.all(), 0);
}

TEST(WorkMeter, runs_that_could_be_compared_make_one_ratio) {
  Row row;
  EXPECT_EQ(row.parts.meter.times_less(), 0);
  row.parts.meter.compare(1, 1);
  row.parts.meter.compare(2, 5);
  EXPECT_EQ(row.parts.meter.compared(), 2);
  EXPECT_EQ(row.parts.meter.times_less(), 2);
}

TEST(RunEnd, says_one_block_and_all_counters_if_asked_for) {
  for (const ReportLength length : {ReportLength::brief, ReportLength::full}) {
    Settings settings = sleeping_settings();
    settings.report = length;
    SmallWorld world(empty_space());
    WorldParts parts(world, settings, 2 * r);
    world.add(1, Vec3::Zero(), r);
    world.reneighbour();
    const std::size_t counters = length == ReportLength::full ? 2 : 0;
    parts.run_end.tell();
    EXPECT_EQ(world.run.said.size(), counters) << "a run of no step";
    parts.meter.count_step(0);
    parts.run_end.tell();
    ASSERT_EQ(world.run.said.size(), 1 + 2 * counters);
    EXPECT_EQ(world.run.said[counters].find("1 steps, 1 granules\n  exterior      = 1 (100.0 %) on average\n"), 0u)
        << world.run.said[counters];
    EXPECT_EQ(parts.report.value(30), 1);
    EXPECT_EQ(parts.report.value(33), 0);
  }
}

/// Half of 1,200 granules are culled; the engine has spent a quarter of a run's time on pairs.
struct ForecastRun {
  ForecastRun() : world(empty_space()), parts(world, sleeping_settings(), 2 * r) {
    for (int n = 0; n < 1200; ++n) world.add(1 + n, Vec3(0.999 * 2 * r * (n % 30), 4 * r * (n / 30), 0), r);
    world.reneighbour();
    world.compute_forces();
    world.run.pair_forces = 0.25;
  }
  void cull() {
    std::vector<std::int64_t> tags;
    for (int tag = 601; tag <= 1200; ++tag) tags.push_back(tag);
    parts.lock(tags);
    parts.reneighbour();
    parts.bed.census.count_bodies();
    parts.meter.note_new_lists();
  }
  void begin(int steps) {
    world.run.steps_left = steps;
    parts.meter.begin_run(0);
    parts.forecaster.begin_run();
  }
  /// Steps with a look at their end.
  void look_after(int steps) {
    for (int n = 0; n < steps; ++n) parts.meter.count_step(0);
    world.run.step += steps;
    world.run.steps_left -= steps;
    parts.forecaster.see_look();
  }
  /// To where a forecast is due, slowly enough for one.
  void to_the_forecast(int looks) {
    for (int n = 0; n < looks; ++n) {
      look_after(parts.bed.scales.look_every());
      if (n == looks - 2) std::this_thread::sleep_for(std::chrono::milliseconds(600));
      world.run.pair_forces += 0.25 / looks;
    }
  }
  double forecast() { return parts.report.value(34); }
  SmallWorld world;
  WorldParts parts;
};

TEST(Forecaster, says_in_each_run_what_it_will_gain) {
  ForecastRun r;
  r.cull();
  for (const std::size_t told : {1u, 2u}) {
    r.begin(200 * r.parts.bed.scales.look_every());
    EXPECT_EQ(r.forecast(), 0);
    r.to_the_forecast(60);
    ASSERT_EQ(r.world.run.said.size(), told - 1) << "three tenths of the run have not passed since the first look";
    r.to_the_forecast(2);
    ASSERT_EQ(r.world.run.said.size(), told);
    EXPECT_EQ(r.world.run.said.back().find("if it goes on like this, the run will be about "), 0u) << r.world.run.said.back();
    EXPECT_GT(r.forecast(), 0);
    EXPECT_NEAR(r.parts.report.value(35), 0.5, 1e-12) << "of the granules is exterior";
    r.to_the_forecast(5);
    EXPECT_EQ(r.world.run.said.size(), told) << "once in a run";
    r.parts.meter.end_run(0);
  }
}

TEST(Forecaster, says_nothing_where_nothing_is_culled_or_only_late_in_a_run) {
  ForecastRun r;
  r.begin(200 * r.parts.bed.scales.look_every());
  r.to_the_forecast(80);
  EXPECT_TRUE(r.world.run.said.empty());
  r.cull();
  r.to_the_forecast(70);  // due when more than six tenths are over
  EXPECT_TRUE(r.world.run.said.empty());
  EXPECT_EQ(r.forecast(), 0);
}

}  // namespace
}  // namespace solidcull
