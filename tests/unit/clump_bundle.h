// A bundle of clumps that press on each other, for tests of the culling.
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <mutex>
#include <set>
#include <utility>
#include <vector>

#include "world_parts.h"

namespace solidcull {

/// 2 x 2 x 2 rods of three spheres along x, with the tags 1 to 24, and a single granule, 25, at their end. The rods' middle
/// spheres are at -2.2 r and 2.2 r from `middle`.
struct ClumpBundle {
  static constexpr int rods = 8, spheres = 3 * rods, granules = spheres + 1;
  static constexpr double step = 1.2 * r;  // between spheres of a rod

  /// gap: of neighbours, centre to centre (m). backwards: the sphere with the lowest tag, which will have the mass, is the right
  /// one.
  static void make(SmallWorld& w, const Vec3& middle, double gap, bool backwards = false, bool still = false) {
    for (int n = 0; n < rods; ++n) {
      const Vec3 from = middle + Vec3(n % 2 ? 0.5 * gap : -0.5 * gap - 2 * step, (n / 2 % 2 - 0.5) * gap, (n / 4 - 0.5) * gap);
      std::vector<Sphere> rod;
      for (int k = 0; k < 3; ++k) rod.push_back({from + Vec3((backwards ? 2 - k : k) * step, 0, 0), r});
      const double own = still ? 0 : 1e-4;  // no rigid motion
      w.clumps.make(3 * n + 1, rod, own * Vec3(n % 3, 1 - n % 2, 0.3 * n), 200 * own * Vec3(n % 2, 0.2 * n, n % 3));
    }
    const Vec3 end = middle + Vec3(1.5 * gap + 2 * step, -0.5 * gap, -0.5 * gap);
    w.add(granules, end, r, still ? Vec3(Vec3::Zero()) : Vec3(1e-4, 0, 2e-4));
  }
  static SmallDeck deck(const std::array<int, 3>& split = {1, 1, 1}) {
    SmallDeck d = empty_space();
    d.clumps = true;
    d.split = split;
    d.box = {Vec3(-0.12, -0.1, -0.1), Vec3(0.12, 0.1, 0.1)};
    return d;
  }
  static int first_of(int tag) { return tag > spheres ? tag : tag - (tag - 1) % 3; }  // the lowest tag of its clump
};

/// What the ranks have in the engine's hands together.
struct OfAllRanks {
  std::mutex mutex;
  double mass = 0, motion = 0, turning_motion = 0;  // of which momenta may be sums
  Vec3 momentum = Vec3::Zero(), turning = Vec3::Zero();
  std::map<int, Vec3> places, velocities;  // by tag
  std::map<int, int> rank_of;              // likewise
  std::map<int, Clump> clumps;             // by number
  std::map<int, int> spheres;              // of each clump

  void add(SmallWorld& w) {
    const std::lock_guard<std::mutex> lock(mutex);
    for (int i = 0; i < w.atoms.owned; ++i) {
      const int tag = w.atoms.tag[i];
      if (!places.emplace(tag, w.atoms.place(i)).second) ADD_FAILURE() << "two ranks have granule " << tag;
      velocities[tag] = w.atoms.velocity(i);
      rank_of[tag] = w.ranks.me;
      if (w.clumps.of(i))
        ++spheres[w.clumps.of(i)];
      else
        add(w.atoms.mass[i], w.atoms.place(i), w.atoms.velocity(i),
            0.4 * w.atoms.mass[i] * w.atoms.radius[i] * w.atoms.radius[i] * w.atoms.spin(i));
    }
    for (int k = 0; k < w.clumps.count(); ++k) {
      const Clump c = w.clumps.clump(k);
      if (!clumps.emplace(c.number, c).second) ADD_FAILURE() << "two ranks move clump " << c.number;
      add(c.mass, c.lies.centre, c.velocity, c.angular_momentum);
    }
  }
  void add(double m, const Vec3& x, const Vec3& v, const Vec3& own) {
    const Vec3 l = x.cross(m * v) + own;
    mass += m;
    momentum += m * v;
    turning += l;
    motion += m * v.norm();
    turning_motion += l.norm();
  }
};

inline Settings settings_of(Store store) {
  Settings s = sleeping_settings();
  s.store = store;
  return s;
}

/// The bundle in motion, with contacts that have histories, and all that the culling has to ask.
struct BundleParts {
  explicit BundleParts(SmallWorld& w, const Vec3& middle = Vec3::Zero(), bool backwards = false, Store store = Store::exact)
      : world(w), parts(w, settings_of(store), 2 * r) {
    ClumpBundle::make(w, middle, 0.98 * 2 * r, backwards);
    w.begin_run(nullptr);
    w.steps(nullptr, 5);
    w.reneighbour();
    for (int tag = 1; tag <= ClumpBundle::granules; ++tag) tags.push_back(tag);
  }
  void lock() {
    parts.lock(tags);
    parts.reneighbour();
    parts.bed.index.index(world.atoms);
  }
  /// As a change does: all that may go, and it goes to the rank that has its place.
  void store() {
    parts.walls.update({}, false);
    parts.closure.share();
    parts.deep.store({true, false, true, ClumpBundle::granules},
                     [&](const std::vector<int>& atoms, const DeepGranules::Near&) { return parts.exchange.put_away(atoms); });
    parts.send_home();
    parts.reneighbour();
    parts.bed.index.index(world.atoms);
  }
  void wake(Wakes wakes) {
    parts.change(std::move(wakes), {});
    parts.reneighbour();
    parts.bed.index.index(world.atoms);
  }
  void wake_all() {
    Wakes all;
    all.all = Woke::deck;
    wake(all);
  }
  /// All bodies are elsewhere, a step later.
  void shift(const Vec3& by) {
    ++world.run.step;
    parts.exchange.forget_past_motions();
    for (auto& [number, body] : parts.bed.solid.bodies_in_motion()) {
      body.shift(by);
      body.take_twist();
    }
    parts.motion.begin_lists();
    parts.motion.refresh();
    parts.motion.place();
  }
  std::set<std::int64_t> stored() const {
    std::set<std::int64_t> all;
    parts.bed.solid.store().for_each([&](const Resident& g) { all.insert(g.tag); });
    return all;
  }
  void check() { EXPECT_NO_THROW(parts.invariants.check()); }

  SmallWorld& world;
  WorldParts parts;
  std::vector<std::int64_t> tags;
};

}  // namespace solidcull
