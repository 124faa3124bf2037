// What the engine sets for no new granule: a granule that comes where others were culled finds it as in a run that never culled.
#include <gtest/gtest.h>

#include <algorithm>
#include <climits>
#include <map>
#include <string>
#include <vector>

#include "atom.h"
#include "engine.h"
#include "fix.h"
#include "lammps.h"
#include "modify.h"

namespace decks {
namespace {

/// By tag, what a fix keeps for each granule that came in on this rank, in one of its first `rows`.
std::map<int, std::vector<double>> kept_for_new_granules(Engine& e, const std::string& fix, int granules, int rows) {
  LAMMPS_NS::LAMMPS* lmp = e.lammps();
  const int at = lmp->modify->find_fix(fix.c_str());
  std::map<int, std::vector<double>> kept;
  for (int i = 0; at >= 0 && i < std::min(rows, lmp->atom->nlocal); ++i) {
    if (lmp->atom->tag[i] <= granules) continue;
    std::vector<double> values(100);
    values.resize(static_cast<std::size_t>(lmp->modify->fix[at]->pack_exchange(i, values.data())));
    kept[lmp->atom->tag[i]] = values;
  }
  return kept;
}

TEST(NewGranules, FindTheirRowsAsIfNoneHadBeenThere) {
  Bed bed;
  bed.name = "new_granules";
  bed.mesh_walls = true;
  // a sort takes the row behind the last granule to swap two, and leaves it so
  const std::string kept = "atom_modify sort 0 0\ncompute moved all displace/atom\nfix was all store/state 0 x y z\n";
  const std::string come =
      "fix t1 all particletemplate/sphere 15485863 atom_type 1 density constant 2500 radius constant 0.0008\n"
      "fix dist all particledistribution/discrete 32452843 1 t1 1.0\n"
      "region above block 0 0.026 0 0.026 0.03 0.045\n"
      "fix once all insert/pack seed 32452867 distributiontemplate dist maxattempt 300 insert_every once overlapcheck yes all_in "
      "yes "
      "vel constant 0 0 -0.1 region above particles_in_region 200\nrun 20\n";
  Engine never, culled;
  never.run(read_bed(bed) + kept + "run 200\n" + come);
  culled.run(read_bed(bed) + kept);
  const int rows = culled.lammps()->atom->nlocal;
  culled.run("fix cull all solid/cull exterior sleep every 50 calm 2 speed 0.05 tolerance 12 0\nrun 200\n");
  ASSERT_GT(culled.vector("cull", 3), 600) << "hardly a row is vacated";
  culled.run(come);
  for (const char* fix : {"moved_COMPUTE_STORE", "was"}) {
    const auto expected = kept_for_new_granules(never, fix, bed.granules, INT_MAX);
    const auto found = kept_for_new_granules(culled, fix, bed.granules, rows);
    EXPECT_FALSE(found.empty() && never.ranks() == 1) << fix;
    for (const auto& [tag, row] : found) {
      const auto there = expected.find(tag);
      ASSERT_NE(there, expected.end()) << fix << ' ' << tag;
      // stock sets no such row: it is 0 in fresh memory, and chance in memory that was used before
      EXPECT_EQ(row, std::vector<double>(there->second.size(), 0.0)) << fix << ' ' << tag;
    }
  }
}

}  // namespace
}  // namespace decks
