#include "seams.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include "box.h"
#include "sphere_cells.h"
#include "sphere_order.h"

namespace solidcull {

/// A pore reaches two radii of the closing ball beyond the border; what is there is to be right.
double Seams::width() const {
  const double closing = bed_.scales.closing();
  return InterfaceMesh::context(bed_.scales.voxel(), closing) + 2 * closing + bed_.solid.store().largest_radius();
}

/// Of bodies over several ranks: this rank's granules near others, and theirs near it. Periodic images are left out, for a mesh
/// ends at a periodic side on one rank, too; so is what has passed such a side and is not where its mesh is.
Seams::Granules Seams::granules_near_others() const {
  struct Row {
    Triple at;
    Triple place;
    double radius;
    BodyGroups::Key number;
  };
  const Ranks& ranks = bed_.ranks;
  const double near = width();
  Box far{Vec3::Constant(-HUGE_VAL), Vec3::Constant(HUGE_VAL)};  // from all others
  const std::array<std::vector<double>, 3> cuts = ranks.cuts();
  const Box own = ranks.own();
  for (int d = 0; d < 3; ++d) {
    if (own.lo[d] > cuts[static_cast<std::size_t>(d)].front()) far.lo[d] = own.lo[d] + near;
    if (own.hi[d] < cuts[static_cast<std::size_t>(d)].back()) far.hi[d] = own.hi[d] - near;
  }
  std::vector<Row> rows;
  const auto offer = [&](const Vec3& x, double radius, int body) {
    if (far.holds(x) || !bed_.groups.spans(body) || bed_.run.wrapped(x) != x) return;
    rows.push_back({triple(x), triple(x), radius, bed_.groups.key_of(body)});
  };
  for (int i = 0; i < bed_.atoms.owned; ++i)
    if (bed_.shell[i].in_body()) offer(bed_.atoms.place(i), bed_.atoms.radius[i], bed_.shell[i].body);
  bed_.solid.store().for_each([&](const Resident& g) { offer(bed_.solid.in_world(g), g.radius, g.body); });

  Granules all;
  for (const Row& r : rows) all[r.number].push_back({vec(r.at), r.radius});
  for (const Row& r : ranks.exchange(rows, near))
    if (vec(r.at) == vec(r.place)) all[r.number].push_back({vec(r.at), r.radius});
  return all;
}

void Seams::bring_up_to_date(Kept& kept, std::vector<Sphere> granules) const {
  std::sort(granules.begin(), granules.end(), before);
  std::vector<Sphere> changed;
  std::set_symmetric_difference(kept.granules.begin(), kept.granules.end(), granules.begin(), granules.end(),
                                std::back_inserter(changed), before);
  for (const Sphere& s : changed) kept.mesh.touch(s);
  kept.granules = std::move(granules);
}

std::map<BodyGroups::Key, InterfaceMesh> Seams::ask() {
  Granules granules = granules_near_others();
  for (auto k = kept_.begin(); k != kept_.end();) k = granules.count(k->first) ? std::next(k) : kept_.erase(k);
  std::map<BodyGroups::Key, InterfaceMesh> seams;
  if (granules.empty()) return seams;

  const double voxel = bed_.scales.voxel(), closing = bed_.scales.closing(), cell = 2 * bed_.scales.diameter();
  const Box own = bed_.ranks.own();
  SphereCells exterior;
  exterior.build(meshes_.exterior_granules(), cell);
  for (auto& [number, spheres] : granules) {
    Kept& kept = kept_.try_emplace(number, Kept{InterfaceMesh(voxel, closing), {}}).first->second;
    bring_up_to_date(kept, std::move(spheres));
    SphereCells cells;
    cells.build(kept.granules, cell);
    const InterfaceMesh::Gather members = [&](const Vec3& lo, const Vec3& hi, const auto& visit) {
      cells.for_each_in_box(lo, hi, [&](std::size_t, const Sphere& s) {
        visit(s);
        return true;
      });
    };
    kept.mesh.update(members, cells.largest_radius());
    kept.mesh.leave_out(BodyMeshes::near(kept.mesh, exterior), members, cells.largest_radius());
    seams.emplace(number, kept.mesh.within(own.lo, own.hi));
  }
  return seams;
}

}  // namespace solidcull
