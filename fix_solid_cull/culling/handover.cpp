#include "handover.h"

#include <algorithm>
#include <utility>

namespace solidcull {

/// What came along with the one that is gone was farther out than what it came to.
void Handover::merged(int gone, int kept, bool) {
  const auto from = at_home_.find(gone);
  if (from == at_home_.end()) return;  // nothing of it was stored when the last change ended
  const auto to = at_home_.find(bed_.solid.store().frame_of(kept));
  if (to != at_home_.end()) to->second.lag = std::max(to->second.lag, from->second.way + from->second.lag);
  at_home_.erase(from);
}

/// A stored one may lag behind by the slack: bodies that have not moved by it since they were last looked through are left. So
/// are granules that were put away in this very step, a little beyond a border: they still have the motion of before here.
std::vector<std::int64_t> Handover::stored_elsewhere() {
  const double waits = 0.25 * bed_.stored.slack();
  const Box nearby = bed_.ranks.own().grown_by(waits);
  std::vector<std::int64_t> tags;
  bed_.solid.store().for_each_frame([&](int frame, const Vec3& lo, const Vec3& hi) {
    const Pose& pose = bed_.solid.pose_of_frame(frame);
    const auto then = at_home_.find(frame);
    if (then != at_home_.end()) {
      Home& home = then->second;
      home.way = largest_way(home.pose, pose, lo, hi);
      if (home.way + home.lag < 0.5 * bed_.stored.slack()) return;
    }
    Home& home = at_home_[frame] = {pose};
    bed_.solid.store().for_each_in_box(frame, lo, hi, [&](const Resident& g) {
      const Vec3 x = bed_.solid.in_world(g);
      if (bed_.ranks.owns(x) || follows_another(g.tag)) return;
      if (bed_.solid.store().transient_known(g.tag) && nearby.holds(x))
        home.lag = waits;
      else
        tags.push_back(g.tag);
    });
  });
  std::sort(tags.begin(), tags.end());
  return tags;
}

/// It is a sphere of a clump, and does not have its mass.
bool Handover::follows_another(std::int64_t tag) const {
  if (!bed_.clumps.possible) return false;
  const StoredGranule g = bed_.solid.store().get(tag);
  return g.clump && !g.has_clump;
}

/// A sphere may be as far from its clump's home as two spheres of one are from each other.
std::vector<int> Handover::neighbours() const {
  return bed_.ranks.neighbours(bed_.clumps.possible ? bed_.clump_spheres.reach() : 0.0);
}

/// What has gone past all neighbours waits for another change, or is lost with its atom.
bool Handover::find_leaving(const std::vector<DeepGranules::AwayFromHome>& away) {
  bed_.arrivals.clear();
  leaving_.clear();
  if (bed_.ranks.count == 1) return false;
  const std::vector<int> neighbours = this->neighbours();
  const auto goes_to = [&](const Vec3& place) -> Leaving* {
    const int owner = bed_.ranks.owner(place);
    if (owner == bed_.ranks.me || !std::binary_search(neighbours.begin(), neighbours.end(), owner)) return nullptr;
    return &leaving_[owner];
  };
  const Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned; ++i) {
    if (!bed_.shell[i].locked || !bed_.run.keeps(atoms.place(i))) continue;  // the engine drops it on the way
    if (Leaving* const to = goes_to(atoms.place(i))) to->atoms.push_back(atoms.tag[i]);
  }
  for (const std::int64_t tag : stored_elsewhere())
    if (Leaving* const to = goes_to(bed_.solid.in_world(*bed_.solid.store().find(tag)))) to->stored.push_back(tag);
  if (bed_.clumps.possible) keep_clumps_whole(away);
  for (auto& [rank, to] : leaving_) std::sort(to.atoms.begin(), to.atoms.end());
  return !leaving_.empty();
}

/// A stored clump is where the sphere is that has its mass.
void Handover::keep_clumps_whole(const std::vector<DeepGranules::AwayFromHome>& away) {
  for (auto& [rank, to] : leaving_) bed_.solid.add_rest_of_clumps(to.stored);
  for (const DeepGranules::AwayFromHome& g : away)
    if (bed_.solid.store().contains(g.tag)) leaving_[g.rank].stored.push_back(g.tag);
  for (auto& [rank, to] : leaving_) {
    std::sort(to.stored.begin(), to.stored.end());
    to.stored.erase(std::unique(to.stored.begin(), to.stored.end()), to.stored.end());
  }
}

/// They leave this rank's part of their bodies; contacts with what stays are kept.
void Handover::leave() {
  Leaving all;
  for (const auto& [rank, to] : leaving_) {
    all.atoms.insert(all.atoms.end(), to.atoms.begin(), to.atoms.end());
    all.stored.insert(all.stored.end(), to.stored.begin(), to.stored.end());
  }
  std::sort(all.atoms.begin(), all.atoms.end());
  std::sort(all.stored.begin(), all.stored.end());
  std::vector<std::int64_t> leaving = all.atoms;
  leaving.insert(leaving.end(), all.stored.begin(), all.stored.end());
  std::vector<GranuleMass> masses;
  for (const std::int64_t tag : leaving) masses.push_back(bed_.masses(tag));
  for (const std::int64_t tag : all.atoms) bed_.leaves_rank(bed_.index.at(tag));
  std::vector<double> record;
  for (const std::int64_t tag : all.stored) bed_.solid.bring_back(tag, record);
  for (std::size_t k = 0; k < leaving.size(); ++k) bed_.solid.unlock(leaving[k], masses[k]);
  for (const std::int64_t tag : leaving) bed_.solid.leave_rank(tag);
  bed_.split_bodies();
}

void Handover::send_home() {
  const std::vector<int> neighbours = this->neighbours();
  for (const int rank : neighbours) {
    const auto to = leaving_.find(rank);
    std::vector<double> numbers;
    if (to != leaving_.end()) numbers = parcels_.pack(to->second.stored, to->second.atoms);
    bed_.ranks.send_rows(rank, numbers);
  }
  if (!leaving_.empty()) leave();
  leaving_.clear();
  std::vector<std::vector<double>> came;  // parcels point into them
  std::vector<Parcel> parcels;
  for (const int rank : neighbours) {
    came.push_back(bed_.ranks.receive_rows<double>(rank));
    for (Parcel& p : parcels_.unpack(came.back().data(), came.back().size(), bed_.solid.contacts().width())) {
      p.for_this_rank = true;  // the other rank has seen to that, by places that are rounded here
      parcels.push_back(std::move(p));
    }
  }
  parcels_.take_up(parcels);
}

void Handover::forget_clumps_that_left() {
  FlatMap<char> here;
  for (int i = 0; i < bed_.atoms.owned; ++i)
    if (bed_.shell[i].locked && bed_.shell[i].clump) here[bed_.atoms.tag[i]] = 1;
  bed_.locked_clumps.forget_all_but([&](std::int64_t tag) { return here.contains(tag); });
}

std::size_t Handover::take_over() {
  for (int i = 0; i < bed_.atoms.owned; ++i) {
    if (!bed_.shell[i].locked || bed_.shell[i].body != Locked::arriving) continue;
    const Arrival came = bed_.arrivals.take(bed_.atoms.tag[i]);
    bed_.arrives(i, {came.body, came.granule.position});
    bed_.shell.label(i, bed_.groups.key_of(came.body));
  }
  if (bed_.clumps.possible) forget_clumps_that_left();
  const std::vector<LostGranule> missing = bed_.arrivals.take_missing();
  on_the_way_.insert(on_the_way_.end(), missing.begin(), missing.end());
  return missing.size();
}

void Handover::remember() {
  before_.clear();
  if (bed_.solid.bodies().locked() == 0) return;
  const Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned; ++i) {
    const Locked& e = bed_.shell[i];
    if (e.in_body()) before_.push_back({atoms.tag[i], bed_.masses.of_atom(i), e.clump});
  }
}

/// The engine deletes a clump that has lost a sphere.
void Handover::wake_rest_of_clumps(const std::vector<LostGranule>& lost) {
  FlatMap<char> clumps;
  for (const LostGranule& b : lost) {
    if (b.clump == 0) continue;
    clumps[b.clump] = 1;
    if (bed_.ranks.count == 1) continue;
    // the others may be on other ranks, none of them here: all that are as near to it as they wake
    const Pose& pose = bed_.solid.bodies().pose(bed_.solid.bodies().body_of(b.tag));
    bed_.wake.ask(pose.to_world(b.granule.position), bed_.clump_spheres.reach(), Woke::lost);
  }
  if (clumps.empty()) return;
  for (int i = 0; i < bed_.atoms.owned; ++i)
    if (bed_.shell[i].locked && clumps.contains(bed_.shell[i].clump)) {
      bed_.wake.ask(bed_.atoms.place(i), 0.5 * bed_.atoms.radius[i], Woke::lost);
      bed_.shell.set_clump(i, bed_.shell[i].clump, Locked::some_lost);
    }
  bed_.locked_clumps.forget_all_but([&](std::int64_t tag) { return bed_.index.contains(tag); });
}

bool Handover::forget_lost() {
  std::size_t here = 0;
  for (int i = 0; i < bed_.atoms.owned; ++i) here += bed_.shell[i].locked;
  std::vector<LostGranule> lost = std::exchange(on_the_way_, {});
  if (here != bed_.solid.bodies().locked()) {
    FlatMap<char> present;
    for (int i = 0; i < bed_.atoms.owned; ++i) present[bed_.atoms.tag[i]] = 1;
    for (const LostGranule& b : before_)
      if (!present.contains(b.tag) && bed_.solid.bodies().body_of(b.tag) && !bed_.solid.store().contains(b.tag))
        lost.push_back(b);
  }
  if (lost.empty()) return false;
  bed_.index.index(bed_.atoms);
  if (bed_.clumps.possible) wake_rest_of_clumps(lost);
  for (const LostGranule& b : lost) bed_.solid.unlock(b.tag, b.granule);
  for (const LostGranule& b : lost) bed_.solid.thaw(b.tag);
  bed_.split_bodies();
  return true;
}

}  // namespace solidcull
