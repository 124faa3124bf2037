// Speed and memory of the core on beds of granules on a cubic lattice. Cost per granule should not depend on the size of the
// bed; caches and TLB add a factor of a few.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <random>
#include <vector>

#include "frozen_contacts.h"
#include "granule_store.h"
#include "solid_bodies.h"

namespace {

using namespace solidcull;

constexpr double d = 2e-3;  // m
constexpr double h[] = {1, 2, 3};

/// n^3 granules of two sizes; tags from 0.
struct Lattice {
  int n;
  explicit Lattice(std::int64_t granules) : n(static_cast<int>(std::lround(std::cbrt(static_cast<double>(granules))))) {}
  std::int64_t size() const { return std::int64_t{n} * n * n; }
  Vec3 place(std::int64_t tag) const { return d * Vec3(double(tag / n / n), double(tag / n % n), double(tag % n)); }
  double radius(std::int64_t tag) const { return tag % 3 ? 0.5 * d : 0.45 * d; }
  double mass(std::int64_t tag) const { return 1e4 * std::pow(radius(tag), 3); }
  std::int64_t middle() const { return size() / 2 + (n % 2 ? 0 : n * n / 2 + n / 2); }

  StoredGranule granule(std::int64_t tag) const {
    StoredGranule g;
    g.tag = tag;
    g.body = 1;
    g.position = place(tag);
    g.radius = radius(tag);
    g.mass = mass(tag);
    g.lock_step = 1000;
    g.normal_load = 1e-3 * static_cast<double>(tag);
    g.load_change = 1e-5 * g.position;
    return g;
  }
  void add(GranuleStore& store, std::int64_t tag) const {
    static const std::vector<int> transient{0, 1, 2, 3, 4, 5, 13, 14, 15};
    const StoredGranule g = granule(tag);
    std::vector<double> record(28, 1.0);
    record[0] = g.position[0];
    std::memcpy(&record[6], &tag, sizeof tag);  // as the engine packs its ints
    record[10] = g.radius;
    record[12] = g.mass;
    store.add(g, record.data(), static_cast<int>(record.size()), transient);
  }
  void fill(GranuleStore& store) const {
    for (std::int64_t tag = 0; tag < size(); ++tag) add(store, tag);
    store.forget_transient();
  }
  /// Calls visit(neighbour) for the neighbours with lower tags.
  template <class Visit>
  void for_each_lower(std::int64_t tag, Visit visit) const {
    if (tag / n / n) visit(tag - n * n);
    if (tag / n % n) visit(tag - n);
    if (tag % n) visit(tag - 1);
  }
  void touch(FrozenContacts& contacts) const {
    contacts.set_layout({true, true, true});
    for (std::int64_t tag = 0; tag < size(); ++tag) for_each_lower(tag, [&](std::int64_t other) { contacts.add(tag, other, h); });
  }
  SolidBodies::MassOf mass_of() const {
    return [this](std::int64_t tag) { return GranuleMass{mass(tag), place(tag), radius(tag)}; };
  }
  void lock(SolidBodies& bodies, std::int64_t tag, const FrozenContacts& contacts) const {
    bodies.lock(tag, {mass(tag), radius(tag), place(tag), Vec3::Zero(), Vec3::Zero()}, contacts, mass_of());
  }
};

void store_add(benchmark::State& state) {
  const Lattice lattice(state.range(0));
  double bytes = 0;
  for (auto _ : state) {
    GranuleStore store(2 * d);
    lattice.fill(store);
    bytes = store.bytes_per_granule();
  }
  state.SetItemsProcessed(state.iterations() * lattice.size());
  state.counters["bytes_per_granule"] = bytes;
}

/// One out and in again.
void store_take_and_add(benchmark::State& state) {
  const Lattice lattice(state.range(0));
  GranuleStore store(2 * d);
  lattice.fill(store);
  std::mt19937 random(1);
  std::vector<double> record;
  for (auto _ : state) {
    const std::int64_t tag = random() % lattice.size();
    const StoredGranule g = store.take(tag, record);
    store.add(g, record.data(), static_cast<int>(record.size()));
  }
  state.SetComplexityN(lattice.size());
}

void store_find(benchmark::State& state) {
  const Lattice lattice(state.range(0));
  GranuleStore store(2 * d);
  lattice.fill(store);
  std::mt19937 random(2);
  for (auto _ : state) benchmark::DoNotOptimize(store.find(random() % (2 * lattice.size())));  // half of them are there
  state.SetComplexityN(lattice.size());
}

void store_near(benchmark::State& state) {
  const Lattice lattice(state.range(0));
  GranuleStore store(2 * d);
  lattice.fill(store);
  std::mt19937 random(3);
  std::int64_t seen = 0;
  for (auto _ : state)
    store.for_each_near(1, {lattice.place(random() % lattice.size()), 0.5 * d}, 0.2 * d, [&](const Resident&) { ++seen; });
  state.SetComplexityN(lattice.size());
  state.counters["seen_each"] = static_cast<double>(seen) / static_cast<double>(state.iterations());
}

/// Neighbours after each other, as a walk over the bed asks for them: what caches and TLB do to store_near is not here.
void store_near_in_order(benchmark::State& state) {
  const Lattice lattice(state.range(0));
  GranuleStore store(2 * d);
  lattice.fill(store);
  std::int64_t seen = 0, tag = lattice.size() / 3;
  for (auto _ : state) {
    store.for_each_near(1, {lattice.place(tag), 0.5 * d}, 0.2 * d, [&](const Resident&) { ++seen; });
    tag = (tag + 1) % lattice.size();
  }
  state.SetComplexityN(lattice.size());
  state.counters["seen_each"] = static_cast<double>(seen) / static_cast<double>(state.iterations());
}

/// All contacts of a granule away and back again.
void contacts_erase_and_add(benchmark::State& state) {
  const Lattice lattice(state.range(0));
  FrozenContacts contacts;
  lattice.touch(contacts);
  std::mt19937 random(4);
  std::vector<std::int64_t> partners;
  for (auto _ : state) {
    const std::int64_t tag = random() % lattice.size();
    partners.clear();
    contacts.for_each_partner(tag, [&](std::int64_t partner) { partners.push_back(partner); });
    contacts.erase(tag);
    for (const std::int64_t partner : partners) contacts.add(tag, partner, h);
  }
  state.SetComplexityN(lattice.size());
  state.counters["bytes_per_edge"] = static_cast<double>(contacts.memory_bytes()) / static_cast<double>(contacts.size());
}

void bodies_lock(benchmark::State& state) {
  const Lattice lattice(state.range(0));
  FrozenContacts contacts;
  lattice.touch(contacts);
  for (auto _ : state) {
    SolidBodies bodies;
    for (std::int64_t tag = 0; tag < lattice.size(); ++tag) lattice.lock(bodies, tag, contacts);
  }
  state.SetItemsProcessed(state.iterations() * lattice.size());
}

/// A ball of 257 granules is carved out of the middle, with all that goes with it, and locked again (not timed).
void carve_and_split(benchmark::State& state) {
  const Lattice lattice(state.range(0));
  FrozenContacts contacts;
  SolidBodies bodies;
  GranuleStore store(2 * d);
  lattice.touch(contacts);
  lattice.fill(store);
  for (std::int64_t tag = 0; tag < lattice.size(); ++tag) lattice.lock(bodies, tag, contacts);
  const Vec3 centre = lattice.place(lattice.middle());
  const double radius = 4.01 * d;
  std::vector<double> record;
  std::vector<std::int64_t> carved;
  for (auto _ : state) {
    carved.clear();
    store.for_each_in_box(1, centre - Vec3::Constant(radius), centre + Vec3::Constant(radius), [&](const Resident& g) {
      if ((g.position - centre).norm() <= radius) carved.push_back(g.tag);
    });
    for (const std::int64_t tag : carved) {
      const StoredGranule g = store.take(tag, record);
      bodies.unlock(tag, {g.mass, g.position, g.radius}, contacts);
    }
    for (const std::int64_t tag : carved) contacts.erase(tag);
    bodies.split(contacts, lattice.mass_of(), [](std::int64_t, int, const Vec3&) { std::abort(); });  // nothing comes off
    state.PauseTiming();
    for (const std::int64_t tag : carved) {
      lattice.add(store, tag);
      lattice.for_each_lower(tag, [&](std::int64_t other) { contacts.add(tag, other, h); });
      for (const int step : {1, lattice.n, lattice.n * lattice.n}) contacts.add(tag, tag + step, h);
    }
    for (const std::int64_t tag : carved) lattice.lock(bodies, tag, contacts);
    store.forget_transient();
    state.ResumeTiming();
  }
  state.SetComplexityN(lattice.size());
  state.counters["carved"] = static_cast<double>(carved.size());
}

#define OVER_SIZES ->RangeMultiplier(10)->Range(10000, 1000000)
BENCHMARK(store_add) OVER_SIZES->Unit(benchmark::kMillisecond);
BENCHMARK(store_take_and_add) OVER_SIZES->Complexity();
BENCHMARK(store_find) OVER_SIZES->Complexity();
BENCHMARK(store_near) OVER_SIZES->Complexity();
BENCHMARK(store_near_in_order) OVER_SIZES->Complexity();
BENCHMARK(contacts_erase_and_add) OVER_SIZES->Complexity();
BENCHMARK(bodies_lock) OVER_SIZES->Unit(benchmark::kMillisecond);
BENCHMARK(carve_and_split) OVER_SIZES->Unit(benchmark::kMicrosecond)->Complexity();

}  // namespace
