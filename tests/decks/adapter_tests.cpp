// EngineRanks and GranuleRecords: who sees which row, and what of a granule comes back, against what the engine's own arrays say.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>
#include <tuple>
#include <vector>

#include "atom.h"
#include "atom_vec.h"
#include "domain.h"
#include "engine.h"
#include "fix.h"
#include "granule_records.h"
#include "lammps.h"
#include "modify.h"
#include "ranks.h"

namespace decks {
namespace {

using solidcull::EngineRanks;
using solidcull::GranuleRecords;
using solidcull::Triple;
using solidcull::Vec3;

Bed small(bool periodic) {
  Bed bed;
  bed.name = periodic ? "adapter_periodic" : "adapter";
  bed.granules = 300;
  bed.side = 0.018;
  bed.periodic = periodic;
  return bed;
}

struct Row {
  Triple at;
  int tag, rank;
};

std::vector<Row> rows_of(Engine& e) {
  const LAMMPS_NS::Atom* a = e.lammps()->atom;
  std::vector<Row> rows;
  for (int i = 0; i < a->nlocal; ++i) rows.push_back({{a->x[i][0], a->x[i][1], a->x[i][2]}, a->tag[i], e.rank()});
  return rows;
}

class RanksNear : public testing::TestWithParam<bool> {};

/// Each row is seen on the ranks, and by the images, that it is near, and nowhere else. Collective.
void expect_seen(Engine& e, const EngineRanks& ranks, const std::vector<Row>& mine, double width) {
  const LAMMPS_NS::Domain* box = e.lammps()->domain;
  using Seen = std::multiset<std::tuple<int, double, double, double>>;
  Seen expected, seen;
  for (const Row& r : ranks.gather(mine))
    for (const Vec3& shift : ranks.image_shifts()) {
      if (r.rank == e.rank() && shift.isZero(0)) continue;
      const double x[3] = {r.at[0] + shift[0], r.at[1] + shift[1], r.at[2] + shift[2]};
      bool near = true;
      for (int d = 0; d < 3; ++d) {  // a side that is not periodic has nothing behind it: what is there is the last rank's
        const bool open = box->boundary[d][0] != 0;
        near = near && (x[d] >= box->sublo[d] - width || (open && box->sublo[d] <= box->boxlo[d])) &&
               (x[d] <= box->subhi[d] + width || (open && box->subhi[d] >= box->boxhi[d]));
      }
      if (near) expected.insert({r.tag, x[0], x[1], x[2]});
    }
  for (const Row& r : ranks.exchange(mine, width)) seen.insert({r.tag, r.at[0], r.at[1], r.at[2]});
  EXPECT_EQ(seen, expected);
  EXPECT_EQ(ranks.any(!seen.empty()), ranks.has_neighbours());
}

TEST_P(RanksNear, EachSeesWhatIsWithinTheWidthOfItsSubdomain) {
  Engine e;
  e.run(read_bed(small(GetParam())) + "run 0\n");
  EngineRanks ranks(e.lammps());
  ranks.update();
  EXPECT_EQ(ranks.count, e.ranks());
  EXPECT_EQ(ranks.has_neighbours(), GetParam() || e.ranks() > 1);
  EXPECT_EQ(ranks.image_shifts().size(), GetParam() ? 9u : 1u);
  const std::vector<Row> all = ranks.gather(rows_of(e));
  EXPECT_EQ(all.size(), 300u);
  EXPECT_TRUE(std::is_sorted(all.begin(), all.end(), [](const Row& a, const Row& b) { return a.rank < b.rank; }));
  EXPECT_EQ(ranks.gather_on_root(rows_of(e)).size(), e.rank() == 0 ? 300u : 0u);
  expect_seen(e, ranks, rows_of(e), 0.003);
  expect_seen(e, ranks, rows_of(e), 0.5);  // wider than the box
}

TEST_P(RanksNear, SeeWhatIsFarFromTheRankThatTellsOfIt) {
  Engine e;
  e.run(read_bed(small(GetParam())) + "run 0\n");
  EngineRanks ranks(e.lammps());
  ranks.update();
  std::vector<Row> mine = rows_of(e);
  for (Row& r : mine)
    for (double& x : r.at) x = 0.01 - x;
  expect_seen(e, ranks, mine, 0.003);
}

TEST_P(RanksNear, EachPlaceHasOneOwner) {
  Engine e;
  e.run(read_bed(small(GetParam())) + "run 0\n");
  EngineRanks ranks(e.lammps());
  ranks.update();
  EXPECT_FALSE(ranks.subdomains_changed());
  const std::vector<Row> all = ranks.gather(rows_of(e));
  std::vector<std::int64_t> owners;
  for (const Row& r : all)
    for (const Vec3& shift : ranks.image_shifts()) owners.push_back(ranks.owns(solidcull::vec(r.at) + shift));
  ranks.sum(owners.data(), static_cast<int>(owners.size()));
  EXPECT_TRUE(std::all_of(owners.begin(), owners.end(), [](std::int64_t n) { return n == 1; }));
  std::int64_t largest = e.rank();
  ranks.largest(&largest, 1);
  EXPECT_EQ(largest, e.ranks() - 1);
  EXPECT_TRUE(ranks.any(e.rank() == e.ranks() - 1));
  EXPECT_FALSE(ranks.any(false));
}

INSTANTIATE_TEST_SUITE_P(Adapter, RanksNear, testing::Bool());

/// Whether this rank has granules; some rank has. Collective.
bool has_granules(Engine& e) {
  const int mine = e.lammps()->atom->nlocal;
  int most = 0;
  MPI_Allreduce(&mine, &most, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
  EXPECT_GT(most, 1);
  return mine > 0;
}

/// The first owned granule, packed, deleted and appended again; nothing else touches the atoms.
struct Moved {
  std::vector<double> record, again;
  int layout = 0, layout_again = 0, index = 0;
};

Moved move_first(Engine& e, GranuleRecords& records) {
  Moved m;
  records.pack(0, m.record, m.layout);
  records.remove(0);
  m.index = records.append(m.record, m.layout);
  records.pack(m.index, m.again, m.layout_again);
  EXPECT_EQ(m.index, e.lammps()->atom->nlocal - 1);
  return m;
}

TEST(AdapterRecords, AGranuleComesBackToTheLastBitWithWhatFixesKeepOfIt) {
  Engine e;
  e.run(read_bed(small(false)) + "fix mark all property/atom mark scalar yes no no 3.5\nrun 20\n");
  LAMMPS_NS::Atom* a = e.lammps()->atom;
  if (!has_granules(e)) GTEST_SKIP() << "a rank beside the bed";
  GranuleRecords records(e.lammps(), nullptr);
  const int tag = a->tag[0], count = a->nlocal;
  const std::array<double, 3> x = {a->x[0][0], a->x[0][1], a->x[0][2]};
  const double radius = a->radius[0];
  const Moved m = move_first(e, records);
  EXPECT_EQ(a->nlocal, count);
  EXPECT_EQ(m.layout_again, m.layout);
  ASSERT_EQ(m.again.size(), m.record.size());
  EXPECT_EQ(std::memcmp(m.again.data(), m.record.data(), m.record.size() * sizeof(double)), 0);
  EXPECT_EQ(a->tag[m.index], tag);
  EXPECT_EQ(a->radius[m.index], radius);
  for (int d = 0; d < 3; ++d) {
    EXPECT_EQ(a->x[m.index][d], x[d]);
    EXPECT_EQ(a->f[m.index][d], 0) << "forces are computed anew";
  }
  EXPECT_EQ(records.layout_from_text(records.layout_text(m.layout)), m.layout);
}

TEST(AdapterRecords, AFixThatCameOrWentChangesOnlyItsOwnColumns) {
  Engine e;
  const std::string mark = "fix mark all property/atom mark scalar yes no no 7.5\n";
  e.run(read_bed(small(false)) + "run 20\n");
  LAMMPS_NS::Atom* a = e.lammps()->atom;
  if (!has_granules(e)) GTEST_SKIP() << "a rank beside the bed";
  GranuleRecords records(e.lammps(), nullptr);
  std::vector<double> before;
  int plain = 0;
  records.pack(0, before, plain);
  const int tag = a->tag[0];
  records.remove(0);
  e.run(mark);
  const int i = records.append(before, plain);
  std::vector<double> with;
  int layout = 0;
  records.pack(i, with, layout);
  EXPECT_NE(layout, plain);
  EXPECT_EQ(with.size(), before.size() + 1);
  EXPECT_EQ(std::count(with.begin(), with.end(), 7.5), 1 + std::count(before.begin(), before.end(), 7.5)) << "the fix's default";
  records.remove(i);
  e.run("unfix mark\n");
  const int j = records.append(with, layout);
  std::vector<double> after;
  int last = 0;
  records.pack(j, after, last);
  EXPECT_EQ(last, plain);
  ASSERT_EQ(after.size(), before.size());
  EXPECT_EQ(std::memcmp(after.data(), before.data(), before.size() * sizeof(double)), 0);
  EXPECT_EQ(a->tag[j], tag);
}

TEST(AdapterRecords, MotionWordsAreThoseOfPlaceVelocityAndSpin) {
  Engine e;
  e.run(read_bed(small(false)) + "run 20\n");
  LAMMPS_NS::Atom* a = e.lammps()->atom;
  if (!has_granules(e)) GTEST_SKIP() << "a rank beside the bed";
  GranuleRecords records(e.lammps(), nullptr);
  std::vector<double> record;
  int layout = 0;
  records.pack(0, record, layout);
  const std::vector<int> all = records.motion_words(0, true, true), without_places = records.motion_words(0, false, true);
  std::multiset<double> words, numbers;
  for (const int w : all) words.insert(record[static_cast<std::size_t>(w)]);
  for (int d = 0; d < 3; ++d)
    for (double** of : {a->x, a->v, a->omega}) numbers.insert(of[0][d]);
  EXPECT_EQ(words, numbers);
  EXPECT_EQ(without_places.size(), 6u);
  EXPECT_TRUE(std::includes(all.begin(), all.end(), without_places.begin(), without_places.end()));
}

// A large cull cuts the engine's arrays while it goes on: whoever kept a view of them would read what is no longer there (arrays
// that shrink stay where they are, but for the sanitizers).
TEST(AdapterMemory, ACullThatCutsTheEnginesArraysOnItsWayLosesNothing) {
  // those at walls stay for a step; the others are more than go in between two cuts
  constexpr int granules = 52 * 52 * 50;
  Bed bed;
  bed.side = 0.104;
  Engine e;
  e.run(head(bed) + "region box block 0 0.104 0 0.104 0 0.104 units box\ncreate_box 2 box\nneighbor 0.0003 bin\n" + body(bed) +
        "unfix grav\nlattice sc 0.002 origin 0.5 0.5 0.5\nregion cube block 0 0.104 0 0.104 0 0.1 units box\n"
        "create_atoms 1 region cube\nset group all diameter 0.002 density 2500\nfix move all nve/sphere\n"
        "thermo_modify lost error\nrun 0\n");
  const State before = e.state();
  ASSERT_EQ(before.size(), static_cast<std::size_t>(granules));
  const int room = e.lammps()->atom->nmax;
  e.run("fix cull all solid/cull exterior sleep\nrun 2\n");
  EXPECT_LT(e.vector("cull", 1), 0.01 * granules);
  expect_all_there(e, "cull", granules);
  EXPECT_LT(e.lammps()->atom->nmax, room);
  e.run("unfix cull\nrun 0\n");
  const State after = e.state();
  expect_same_granules(before, after);
  EXPECT_LT(largest_difference(before, after, &Granule::x), 1e-15);
}

}  // namespace
}  // namespace decks
