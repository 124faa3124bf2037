// Restart files with clumps: free ones, locked ones and stored ones.
#include <gtest/gtest.h>

#include <cstdio>
#include <string>

#include "clump_bundle.h"
#include "section_file.h"

namespace solidcull {
namespace {

/// The engine's side of a restart file: atoms, with what follows them, and the clumps that it moves; and the culling's.
struct FileWithClumps : SectionFile {
  struct Atom {
    std::vector<double> record, followers;
  };
  std::vector<Atom> atoms;
  std::vector<Clump> clumps;

  void write(SmallWorld& w, WorldParts& parts) {
    const std::vector<double> numbers = parts.snapshot.write(false);
    parts.snapshot.append_to(end);
    const std::lock_guard<std::mutex> lock(mutex);
    if (!numbers.empty()) state = numbers;
    for (int i = 0; i < w.atoms.owned; ++i) {
      Atom a;
      int layout = 0;
      w.atoms.pack(i, a.record, layout);
      for (FollowsAtoms* f : w.atoms.followers) {
        a.followers.resize(a.followers.size() + static_cast<std::size_t>(f->packed_size()));
        f->pack(i, a.followers.data() + a.followers.size() - f->packed_size());
      }
      atoms.push_back(std::move(a));
    }
    for (int k = 0; k < w.clumps.count(); ++k) clumps.push_back(w.clumps.clump(k));
  }
  void read(SmallWorld& w, WorldParts& parts) const {
    for (const Atom& a : atoms) {
      if (!w.ranks.owns(vec(a.record.data()))) continue;
      const int i = w.atoms.put_back(a.record, 0);
      const double* from = a.followers.data();
      for (FollowsAtoms* f : w.atoms.followers) {
        f->unpack(i, from);
        from += f->packed_size();
      }
    }
    for (const Clump& c : clumps)
      if (w.ranks.owns(c.lies.centre)) w.clumps.read(c);
    parts.snapshot.read(Snapshot::from_bytes(reinterpret_cast<const char*>(state.data())), end);
    parts.snapshot.take_up();
  }
};

/// The bundle's first rod is free, and so what is beside it is an atom; what is not is stored.
void write_some_of_each(SmallWorld& w, FileWithClumps& file, OfAllRanks& written, std::size_t stored[2], Store store) {
  BundleParts bundle(w, Vec3(0.98 * r + ClumpBundle::step, 0, 0), false, store);
  written.add(w);
  bundle.tags.erase(bundle.tags.begin(), bundle.tags.begin() + 3);
  bundle.lock();
  bundle.store();
  bundle.check();
  const std::size_t in_shell = bundle.parts.bed.locked_clumps.all().size(), in_store = bundle.stored().size();
  file.write(w, bundle.parts);
  const std::lock_guard<std::mutex> lock(file.mutex);
  stored[0] += in_shell;
  stored[1] += in_store;
}

TEST(ClumpsInFiles, that_two_ranks_wrote_are_taken_up_by_any_number_of_ranks) {
  for (const Store store : {Store::exact, Store::compact}) {
    FileWithClumps file;
    OfAllRanks written;
    std::size_t stored[2] = {0, 0};  // clumps that are locked, spheres that are stored
    run_on_ranks(ClumpBundle::deck({2, 1, 1}), [&](SmallWorld& w) { write_some_of_each(w, file, written, stored, store); });
    ASSERT_EQ(file.clumps.size(), 1u);
    ASSERT_GE(stored[0], 2u);
    ASSERT_GE(stored[1], 6u);
    const double far = store == Store::exact ? 1e-15 : 1e-7 * 2 * r;  // m; compact rounds places
    for (const std::array<int, 3>& split : {std::array<int, 3>{1, 1, 1}, {2, 1, 1}, {3, 1, 1}, {1, 2, 2}}) {
      OfAllRanks read;
      run_on_ranks(ClumpBundle::deck(split), [&](SmallWorld& w) {
        WorldParts parts(w, settings_of(store), 2 * r);
        file.read(w, parts);
        EXPECT_EQ(w.clumps.highest_number(), 8);  // of a clump that the engine does not have
        EXPECT_GT(w.clumps.largest(), 2.3 * r);
        parts.reneighbour();
        EXPECT_NO_THROW(parts.invariants.check());
        ++w.run
              .step;  // else those in the shell would have their own motions, which the file has, and the others that of the body
        Wakes all;
        all.all = Woke::deck;
        parts.bed.index.index(w.atoms);
        parts.change(all, {});
        parts.reneighbour();
        EXPECT_EQ(parts.bed.solid.locked(), 0u);
        read.add(w);
        EXPECT_EQ(w.clumps.make(201, {{Vec3(0.08, 0, 0), r}, {Vec3(0.08, 0, r), r}}), 9);
      });
      ASSERT_EQ(read.places.size(), 25u);
      ASSERT_EQ(read.clumps.size(), 8u);
      for (const auto& [tag, x] : written.places) EXPECT_LT((read.places.at(tag) - x).norm(), far) << tag;
      for (const auto& [number, c] : written.clumps) {
        const Clump& now = read.clumps.at(number);
        EXPECT_LT((now.lies.centre - c.lies.centre).norm(), far) << number;
        EXPECT_LT((now.lies.tensor() - c.lies.tensor()).norm(), 1e-14 * c.lies.tensor().norm()) << number;
        EXPECT_EQ(now.mass, c.mass) << number;
        EXPECT_EQ(now.spheres, c.spheres) << number;
        EXPECT_EQ(now.rest, c.rest) << number;
        EXPECT_EQ(read.spheres.at(number), 3) << number;
      }
      EXPECT_LT((read.momentum - written.momentum).norm(), 1e-12 * written.motion);
      EXPECT_LT((read.turning - written.turning).norm(), (store == Store::exact ? 1e-12 : 1e-6) * written.turning_motion);
    }
  }
}

}  // namespace
}  // namespace solidcull
