#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <map>
#include <random>
#include <set>
#include <stdexcept>

#include "granule_store.h"

namespace solidcull {
namespace {

using Tags = std::set<std::int64_t>;

StoredGranule granule(std::int64_t tag, const Vec3& position, double radius) {
  StoredGranule g;
  g.tag = tag;
  g.position = position;
  g.radius = radius;
  g.mass = 1e4 * radius * radius * radius;
  g.type = static_cast<int>(tag % 3);
  g.body = 1;
  return g;
}

/// A heap in a cube of edge `size`, radii between `smallest` and `largest`, with the records it was given.
struct Heap {
  GranuleStore store;
  std::map<std::int64_t, StoredGranule> granules;
  std::map<std::int64_t, std::vector<double>> records;
  std::mt19937 random;

  Heap(double cell, unsigned seed) : store(cell), random(seed) {}
  double between(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(random); }
  Vec3 place(double size) {
    const double x = between(-size / 2, size / 2), y = between(-size / 2, size / 2), z = between(-size / 2, size / 2);
    return Vec3(x, y, z);
  }
  void add(std::int64_t tag, double size, double smallest, double largest) {
    StoredGranule g = granule(tag, place(size), between(smallest, largest));
    std::vector<double> record(static_cast<std::size_t>(20 + tag % 5));
    for (double& x : record) x = between(-1, 1);
    store.add(g, record.data(), static_cast<int>(record.size()));
    granules[tag] = g;
    records[tag] = record;
  }
  void take(std::int64_t tag) {
    std::vector<double> record;
    const StoredGranule g = store.take(tag, record);
    ASSERT_EQ(g.tag, tag);
    ASSERT_EQ(g.position, granules[tag].position);
    ASSERT_EQ(g.radius, granules[tag].radius);
    ASSERT_EQ(record, records[tag]);
    granules.erase(tag);
    records.erase(tag);
  }
  Tags near(const Sphere& s, double gap) const {
    Tags tags;
    store.for_each_near(1, s, gap, [&](const StoredGranule& g) {
      EXPECT_TRUE(tags.insert(g.tag).second) << "granule " << g.tag << " is visited twice";
    });
    return tags;
  }
  Tags truly_near(const Sphere& s, double gap) const {
    Tags tags;
    for (const auto& g : granules)
      if ((g.second.position - s.centre).norm() - g.second.radius - s.radius < gap) tags.insert(g.first);
    return tags;
  }
};

TEST(GranuleStore, refuses_cells_without_size) {
  EXPECT_THROW(GranuleStore(0.0), std::invalid_argument);
  EXPECT_THROW(GranuleStore(-1.0), std::invalid_argument);
  EXPECT_THROW(GranuleStore(std::numeric_limits<double>::infinity()), std::invalid_argument);
  EXPECT_THROW(GranuleStore(std::nan("")), std::invalid_argument);
}

TEST(GranuleStore, a_record_comes_back_to_the_bit) {
  const double numbers[] = {-0.0, std::numeric_limits<double>::denorm_min(), std::numeric_limits<double>::quiet_NaN(),
                            -std::numeric_limits<double>::infinity(), 0.1};
  GranuleStore store(1.0);
  StoredGranule g = granule(12, Vec3(0.1, -0.2, 1.0 / 3), 0.05);
  g.layout = 4;
  g.lock_step = 123456789012345;
  g.normal_load = 0.7;
  g.load_change = Vec3(1, 2, 3);
  store.add(g, numbers, 5);
  int length = 0;
  EXPECT_EQ(std::memcmp(store.record(12, length), numbers, sizeof numbers), 0);
  EXPECT_EQ(length, 5);
  std::vector<double> record{1, 2, 3, 4, 5, 6, 7};
  const StoredGranule back = store.take(12, record);
  ASSERT_EQ(record.size(), 5u);
  EXPECT_EQ(std::memcmp(record.data(), numbers, sizeof numbers), 0);
  EXPECT_EQ(back.position, g.position);
  EXPECT_EQ(back.radius, g.radius);
  EXPECT_EQ(back.mass, g.mass);
  EXPECT_EQ(back.tag, g.tag);
  EXPECT_EQ(back.type, g.type);
  EXPECT_EQ(back.body, g.body);
  EXPECT_EQ(back.layout, g.layout);
  EXPECT_EQ(back.lock_step, g.lock_step);
  EXPECT_EQ(back.normal_load, g.normal_load);
  EXPECT_EQ(back.load_change, g.load_change);
}

TEST(GranuleStore, records_of_many_lengths_survive_coming_and_going) {
  Heap heap(0.02, 3);
  std::int64_t next = 1;
  for (int round = 0; round < 40; ++round) {
    for (int n = 0; n < 100; ++n) heap.add(next++, 0.2, 0.001, 0.005);
    std::vector<std::int64_t> leaving;
    for (const auto& g : heap.granules)
      if (heap.random() % 2) leaving.push_back(g.first);
    for (const std::int64_t tag : leaving) heap.take(tag);
    ASSERT_EQ(heap.store.size(), heap.granules.size());
  }
  double mass = 0;
  for (const auto& g : heap.granules) mass += g.second.mass;
  EXPECT_NEAR(heap.store.mass(), mass, 1e-13 * mass);
  while (!heap.granules.empty()) heap.take(heap.granules.begin()->first);
  EXPECT_EQ(heap.store.size(), 0u);
  EXPECT_EQ(heap.store.mass(), 0.0);
}

TEST(GranuleStore, a_granule_without_record_is_kept) {
  GranuleStore store(1.0);
  store.add(granule(1, Vec3::Zero(), 0.1), nullptr, 0);
  std::vector<double> record{1};
  EXPECT_EQ(store.take(1, record).tag, 1);
  EXPECT_TRUE(record.empty());
}

TEST(GranuleStore, a_tag_goes_in_once_and_comes_out_once) {
  GranuleStore store(1.0);
  const double h[] = {1};
  std::vector<double> record;
  int length = 0;
  store.add(granule(5, Vec3::Zero(), 0.1), h, 1);
  EXPECT_THROW(store.add(granule(5, Vec3::Ones(), 0.1), h, 1), std::logic_error);
  EXPECT_EQ(store.size(), 1u);
  EXPECT_THROW(store.take(6, record), std::logic_error);
  EXPECT_THROW(store.record(6, length), std::logic_error);
  EXPECT_EQ(store.find(6), nullptr);
  ASSERT_NE(store.find(5), nullptr);
  EXPECT_EQ(store.find(5)->position, Vec3(Vec3::Zero()));
  store.take(5, record);
  EXPECT_THROW(store.take(5, record), std::logic_error);
  EXPECT_EQ(store.find(5), nullptr);
}

TEST(GranuleStore, near_queries_find_what_brute_force_finds) {
  Heap heap(0.01, 11);
  for (std::int64_t tag = 1; tag <= 3000; ++tag) heap.add(tag, 0.1, 0.0005, 0.005);  // size ratio 10
  std::size_t found = 0;
  for (int n = 0; n < 1000; ++n) {
    const Sphere s{heap.place(0.14), heap.between(0.0002, 0.006)};
    for (const double gap : {0.0, 0.0005, 0.02, -0.001}) {
      const Tags near = heap.near(s, gap);
      ASSERT_EQ(near, heap.truly_near(s, gap));
      found += near.size();
    }
  }
  EXPECT_GT(found, 1000u);
}

TEST(GranuleStore, spheres_larger_than_the_cells_are_found_and_find) {
  Heap heap(0.004, 12);
  for (std::int64_t tag = 1; tag <= 400; ++tag) heap.add(tag, 0.1, 0.001, 0.010);  // diameters up to five cells
  for (int n = 0; n < 300; ++n) {
    const Sphere s{heap.place(0.14), heap.between(0.001, 0.03)};
    for (const double gap : {0.0, 0.003}) ASSERT_EQ(heap.near(s, gap), heap.truly_near(s, gap));
  }
}

TEST(GranuleStore, near_queries_stay_true_while_granules_come_and_go) {
  Heap heap(0.008, 13);
  std::int64_t next = 1;
  for (int round = 0; round < 30; ++round) {
    for (int n = 0; n < 50; ++n) heap.add(next++, 0.06, 0.0005, 0.004);
    std::vector<std::int64_t> leaving;
    for (const auto& g : heap.granules)
      if (heap.random() % 3 == 0) leaving.push_back(g.first);
    for (const std::int64_t tag : leaving) heap.take(tag);
    for (int n = 0; n < 50; ++n) {
      const Sphere s{heap.place(0.08), 0.002};
      ASSERT_EQ(heap.near(s, 0.0005), heap.truly_near(s, 0.0005));
    }
  }
}

TEST(GranuleStore, what_is_far_away_is_near_nothing) {
  Heap heap(0.01, 14);
  EXPECT_TRUE(heap.near({Vec3::Zero(), 0.001}, 1.0).empty()) << "of an empty store";
  for (std::int64_t tag = 1; tag <= 100; ++tag) heap.add(tag, 0.02, 0.001, 0.002);
  EXPECT_TRUE(heap.near({Vec3(1, 0, 0), 0.002}, 0.001).empty());
  EXPECT_TRUE(heap.near({Vec3(0, -50, 0), 0.002}, 0.001).empty());
  EXPECT_TRUE(heap.near({Vec3::Zero(), 0.001}, -1.0).empty()) << "a gap below every overlap";
  EXPECT_EQ(heap.near({Vec3(0, 0, 0.5), 0.002}, 1.0).size(), 100u);
}

TEST(GranuleStore, box_queries_miss_nothing) {
  Heap heap(0.01, 15);
  for (std::int64_t tag = 1; tag <= 1000; ++tag) heap.add(tag, 0.1, 0.001, 0.002);
  for (int n = 0; n < 200; ++n) {
    const Vec3 a = heap.place(0.1), b = heap.place(0.1), lo = a.cwiseMin(b), hi = a.cwiseMax(b);
    Tags visited;
    heap.store.for_each_in_box(1, lo, hi, [&](const StoredGranule& g) { visited.insert(g.tag); });
    for (const auto& g : heap.granules) {
      const Vec3& p = g.second.position;
      if ((p.array() >= lo.array()).all() && (p.array() <= hi.array()).all()) {
        ASSERT_TRUE(visited.count(g.first));
      }
    }
  }
}

TEST(GranuleStore, knows_the_largest_radius_that_ever_went_in) {
  Heap heap(0.01, 16);
  EXPECT_EQ(heap.store.largest_radius(), 0.0);
  heap.add(1, 0.1, 0.002, 0.002);
  heap.add(2, 0.1, 0.007, 0.007);
  EXPECT_EQ(heap.store.largest_radius(), 0.007);
}

TEST(GranuleStore, coming_and_going_takes_no_more_memory) {
  Heap heap(0.01, 17);
  for (std::int64_t tag = 1; tag <= 2000; ++tag) heap.add(tag, 0.1, 0.002, 0.003);
  const std::size_t bytes = heap.store.memory_bytes();
  for (int round = 0; round < 30; ++round) {
    std::vector<std::int64_t> tags;
    for (const auto& g : heap.granules)
      if (heap.random() % 2) tags.push_back(g.first);
    for (const std::int64_t tag : tags) heap.take(tag);
    for (const std::int64_t tag : tags) heap.add(tag, 0.1, 0.002, 0.003);
  }
  // the lists of free places are all that may come on top
  EXPECT_LE(heap.store.memory_bytes(), bytes + 3 * sizeof(std::size_t) * 2000);
}

TEST(GranuleStore, keeps_a_granule_of_a_dense_bed_in_little_more_than_its_record) {
  constexpr double d = 0.0026;
  constexpr int numbers = 20;
  GranuleStore store(2 * d);
  const std::vector<double> record(numbers, 1.0);
  std::int64_t tag = 0;
  for (int i = 0; i < 32; ++i)
    for (int j = 0; j < 32; ++j)
      for (int k = 0; k < 32; ++k) store.add(granule(++tag, d * Vec3(i, j, k), d / 2), record.data(), numbers);
  std::printf("%.0f bytes per granule with a record of %zu\n", store.bytes_per_granule(), numbers * sizeof(double));
  EXPECT_GE(store.bytes_per_granule(), numbers * sizeof(double) + sizeof(StoredGranule));
  EXPECT_LE(store.bytes_per_granule(), 2 * (numbers * sizeof(double) + sizeof(StoredGranule)));
}

// ----------------------------------------------------------------------------------------------------- bodies and their frames

/// Granules of several bodies, each at a place in its own frame, and what the store should know of them.
struct Frames {
  GranuleStore store{0.01};
  std::map<std::int64_t, StoredGranule> granules;
  std::mt19937 random;

  explicit Frames(unsigned seed) : random(seed) {}
  Vec3 place() {
    std::uniform_real_distribution<double> at(-0.05, 0.05);
    const double x = at(random), y = at(random), z = at(random);
    return Vec3(x, y, z);
  }
  double radius() { return std::uniform_real_distribution<double>(0.001, 0.004)(random); }
  void add(std::int64_t tag, int body) {
    StoredGranule g = granule(tag, place(), radius());
    g.body = body;
    const double record[] = {static_cast<double>(tag), g.radius};
    store.add(g, record, 2);
    granules[tag] = g;
  }
  void move(std::int64_t tag, int body) {
    const Vec3 to = place();
    store.move(tag, body, to);
    granules[tag].body = body;
    granules[tag].position = to;
  }
  /// The swallowed body's frame stands in the other one turned and shifted.
  void merge(int swallowed, int kept) {
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(1.3, Vec3(1, 2, 2) / 3).toRotationMatrix();
    const Vec3 shift(0.02, -0.01, 0.03);
    const auto placed = [&](const Vec3& p) { return Vec3(turn * p + shift); };
    store.merge(swallowed, kept, [&](StoredGranule& g) { g.position = placed(g.position); });
    for (auto& g : granules)
      if (g.second.body == swallowed) {
        g.second.body = kept;
        g.second.position = placed(g.second.position);
      }
  }
  void take(std::int64_t tag) {
    std::vector<double> record;
    const StoredGranule g = store.take(tag, record);
    EXPECT_EQ(g.body, granules[tag].body);
    EXPECT_EQ(g.position, granules[tag].position);
    EXPECT_EQ(record, (std::vector<double>{static_cast<double>(tag), g.radius}));
    granules.erase(tag);
  }
  Tags near(int body, const Sphere& s, double gap) const {
    Tags tags;
    store.for_each_near(body, s, gap, [&](const StoredGranule& g) {
      EXPECT_TRUE(tags.insert(g.tag).second) << "granule " << g.tag << " is visited twice";
    });
    return tags;
  }
  Tags truly_near(int body, const Sphere& s, double gap) const {
    Tags tags;
    for (const auto& g : granules)
      if (g.second.body == body && (g.second.position - s.centre).norm() - g.second.radius - s.radius < gap) tags.insert(g.first);
    return tags;
  }
  Tags of(int body) const {
    Tags tags;
    for (const auto& g : granules)
      if (g.second.body == body) tags.insert(g.first);
    return tags;
  }
  Tags in_all_space(int body) const {
    Tags tags;
    store.for_each_in_box(body, Vec3::Constant(-1), Vec3::Constant(1), [&](const StoredGranule& g) { tags.insert(g.tag); });
    return tags;
  }
  void expect_all_known(int bodies) {
    ASSERT_EQ(store.size(), granules.size());
    std::set<int> listed, due;
    store.for_each_body([&](int body, const Vec3& lo, const Vec3& hi) {
      EXPECT_TRUE(listed.insert(body).second);
      for (const std::int64_t tag : of(body)) {
        const Vec3& p = granules[tag].position;
        ASSERT_TRUE((p.array() >= lo.array()).all() && (p.array() <= hi.array()).all()) << "granule out of its body's box";
      }
    });
    for (const auto& g : granules) due.insert(g.second.body);
    ASSERT_EQ(listed, due);
    for (int body = 1; body <= bodies; ++body) {
      ASSERT_EQ(in_all_space(body), of(body));
      const Sphere s{place(), 0.01};
      for (const double gap : {0.0, 0.005, -0.002}) ASSERT_EQ(near(body, s, gap), truly_near(body, s, gap));
    }
  }
};

TEST(GranuleStore, a_query_of_one_body_does_not_see_another) {
  GranuleStore store(0.01);
  StoredGranule g = granule(1, Vec3(0.003, 0, 0), 0.002), h = granule(2, Vec3(0.003, 0, 0), 0.002);
  h.body = 2;  // at the same place in its own frame
  store.add(g, nullptr, 0);
  store.add(h, nullptr, 0);
  const auto seen = [&](int body) {
    Tags tags;
    store.for_each_near(body, {Vec3::Zero(), 0.002}, 0.0, [&](const StoredGranule& s) { tags.insert(s.tag); });
    Tags in_box;
    store.for_each_in_box(body, Vec3::Constant(-0.01), Vec3::Constant(0.01),
                          [&](const StoredGranule& s) { in_box.insert(s.tag); });
    EXPECT_EQ(tags, in_box);
    return tags;
  };
  EXPECT_EQ(seen(1), (Tags{1}));
  EXPECT_EQ(seen(2), (Tags{2}));
  EXPECT_EQ(seen(3), Tags());
  std::vector<double> record;
  store.take(1, record);
  EXPECT_EQ(seen(1), Tags());
  EXPECT_EQ(seen(2), (Tags{2}));
}

TEST(GranuleStore, a_moved_granule_is_found_where_it_is_now_and_nowhere_else) {
  Frames frames(31);
  for (std::int64_t tag = 1; tag <= 50; ++tag) frames.add(tag, 1);
  frames.move(7, 2);
  EXPECT_EQ(frames.store.find(7)->body, 2);
  EXPECT_EQ(frames.store.find(7)->position, frames.granules[7].position);
  frames.expect_all_known(3);
  frames.move(7, 2);  // within its body
  frames.move(8, 1);
  frames.expect_all_known(3);
  frames.take(7);
  frames.expect_all_known(3);
  EXPECT_THROW(frames.store.move(7, 1, Vec3::Zero()), std::logic_error);
}

TEST(GranuleStore, bodies_that_merge_are_one_and_keep_their_records) {
  Frames frames(32);
  for (std::int64_t tag = 1; tag <= 300; ++tag) frames.add(tag, 1 + static_cast<int>(tag % 3));
  const double mass = frames.store.mass();
  frames.merge(3, 1);
  frames.expect_all_known(4);
  EXPECT_TRUE(frames.in_all_space(3).empty());
  EXPECT_EQ(frames.in_all_space(1).size(), 200u);
  frames.merge(4, 1);  // no granule of it is here
  frames.merge(1, 4);  // into one that has none here
  frames.expect_all_known(4);
  EXPECT_EQ(frames.in_all_space(4).size(), 200u);
  EXPECT_EQ(frames.store.mass(), mass);
  while (!frames.granules.empty()) frames.take(frames.granules.begin()->first);
  frames.expect_all_known(4);
}

TEST(GranuleStore, the_box_of_a_body_begins_anew_when_it_was_empty) {
  GranuleStore store(0.01);
  StoredGranule g = granule(1, Vec3(0.5, 0.5, 0.5), 0.002), h = granule(2, Vec3(-0.1, 0.2, 0), 0.002);
  store.add(g, nullptr, 0);
  std::vector<double> record;
  store.take(1, record);
  store.for_each_body([](int, const Vec3&, const Vec3&) { ADD_FAILURE() << "a body without granules"; });
  store.add(h, nullptr, 0);
  int bodies = 0;
  store.for_each_body([&](int body, const Vec3& lo, const Vec3& hi) {
    ++bodies;
    EXPECT_EQ(body, 1);
    EXPECT_EQ(lo, h.position);
    EXPECT_EQ(hi, h.position);
  });
  EXPECT_EQ(bodies, 1);
}

TEST(GranuleStore, knows_its_bodies_while_granules_come_go_move_and_merge) {
  constexpr int bodies = 5;
  Frames frames(33);
  std::int64_t next = 1;
  const auto any_body = [&] { return 1 + static_cast<int>(frames.random() % bodies); };
  for (int round = 0; round < 60; ++round) {
    for (int n = 0; n < 40; ++n) frames.add(next++, any_body());
    std::vector<std::int64_t> leaving, moving;
    for (const auto& g : frames.granules) {
      if (frames.random() % 4 == 0)
        leaving.push_back(g.first);
      else if (frames.random() % 4 == 0)
        moving.push_back(g.first);
    }
    for (const std::int64_t tag : leaving) frames.take(tag);
    for (const std::int64_t tag : moving) frames.move(tag, any_body());
    const int a = any_body(), b = any_body();
    if (a != b) frames.merge(a, b);
    frames.expect_all_known(bodies);
  }
}

// ------------------------------------------------------------------------------------------------ the carve law as geometry

struct Ball {
  Vec3 centre;
  double radius;
};

/// What a ball takes out of the store: the granules whose centres it holds.
Tags held_by(const GranuleStore& store, const Ball& b) {
  Tags tags;
  store.for_each_in_box(1, b.centre - Vec3::Constant(b.radius), b.centre + Vec3::Constant(b.radius), [&](const StoredGranule& g) {
    if ((g.position - b.centre).norm() <= b.radius) tags.insert(g.tag);
  });
  return tags;
}

/// Takes the balls' granules out of a copy of the heap, ball by ball.
Tags freed_one_after_another(const Heap& heap, const std::vector<Ball>& balls) {
  GranuleStore store = heap.store;
  Tags freed;
  std::vector<double> record;
  for (const Ball& b : balls)
    for (const std::int64_t tag : held_by(store, b)) {
      EXPECT_TRUE(freed.insert(tag).second);
      store.take(tag, record);
    }
  EXPECT_EQ(store.size() + freed.size(), heap.store.size());
  return freed;
}

Tags freed_together(const Heap& heap, const std::vector<Ball>& balls) {
  Tags freed;
  for (const Ball& b : balls) freed.merge(held_by(heap.store, b));
  return freed;
}

Tags in_the_union(const Heap& heap, const std::vector<Ball>& balls) {
  Tags tags;
  for (const auto& g : heap.granules)
    for (const Ball& b : balls)
      if ((g.second.position - b.centre).norm() <= b.radius) tags.insert(g.first);
  return tags;
}

void expect_union(const Heap& heap, std::vector<Ball> balls) {
  const Tags due = in_the_union(heap, balls);
  ASSERT_GT(due.size(), 10u);
  EXPECT_EQ(freed_together(heap, balls), due);
  EXPECT_EQ(freed_one_after_another(heap, balls), due);
  std::reverse(balls.begin(), balls.end());
  EXPECT_EQ(freed_one_after_another(heap, balls), due);
}

Heap carved_bed() {
  Heap heap(0.006, 21);
  for (std::int64_t tag = 1; tag <= 4000; ++tag) heap.add(tag, 0.05, 0.001, 0.002);
  return heap;
}

TEST(CarveGeometry, a_ball_in_a_ball_frees_no_more_than_the_larger) {
  const Heap heap = carved_bed();
  const Ball large{Vec3::Zero(), 0.012}, small{Vec3(0.003, 0, 0), 0.005};
  EXPECT_EQ(freed_together(heap, {large, small}), held_by(heap.store, large));
  expect_union(heap, {large, small});
}

TEST(CarveGeometry, touching_balls_free_their_union) {
  expect_union(carved_bed(), {{Vec3(-0.006, 0, 0), 0.006}, {Vec3(0.006, 0, 0), 0.006}});
}

TEST(CarveGeometry, the_same_ball_twice_frees_what_it_frees_once) {
  const Heap heap = carved_bed();
  const Ball ball{Vec3(0.004, -0.002, 0.001), 0.008};
  EXPECT_EQ(freed_together(heap, {ball, ball}), held_by(heap.store, ball));
  expect_union(heap, {ball, ball});
}

TEST(CarveGeometry, many_balls_at_once_free_their_union_in_any_order) {
  Heap heap = carved_bed();
  for (int n = 0; n < 20; ++n) {
    std::vector<Ball> balls;
    for (int b = 0; b < 12; ++b) balls.push_back({heap.place(0.05), heap.between(0.003, 0.015)});
    expect_union(heap, balls);
  }
}

}  // namespace
}  // namespace solidcull
