#include "handover.h"

#include <algorithm>

namespace solidcull {

void Handover::merged(int gone, int kept, bool same_frame) {
  at_home_.erase(gone);
  if (!same_frame) at_home_.erase(kept);
}

/// A stored one may lag behind by the slack: bodies that have not moved by it since they were last looked through are left.
std::vector<std::int64_t> Handover::stored_elsewhere() {
  std::vector<std::int64_t> tags;
  bed_.solid.store().for_each_frame([&](int frame, const Vec3& lo, const Vec3& hi) {
    const Pose& pose = bed_.solid.pose_of_frame(frame);
    const auto then = at_home_.find(frame);
    if (then != at_home_.end() && largest_way(then->second, pose, lo, hi) < 0.5 * bed_.stored.slack()) return;
    at_home_[frame] = pose;
    bed_.solid.store().for_each_in_box(frame, lo, hi, [&](const Resident& g) {
      if (!bed_.ranks.owns(bed_.solid.in_world(g))) tags.push_back(g.tag);
    });
  });
  std::sort(tags.begin(), tags.end());
  return tags;
}

/// They leave this rank's part of their bodies; contacts with what stays are kept.
void Handover::leave(const std::vector<std::int64_t>& atoms, const std::vector<std::int64_t>& stored) {
  std::vector<std::int64_t> leaving = atoms;
  leaving.insert(leaving.end(), stored.begin(), stored.end());
  std::vector<GranuleMass> masses;
  for (const std::int64_t tag : leaving) masses.push_back(bed_.masses(tag));
  for (const std::int64_t tag : atoms) bed_.shell.leaves_rank(bed_.index.at(tag));
  std::vector<double> record;
  for (const std::int64_t tag : stored) bed_.solid.bring_back(tag, record);
  for (std::size_t k = 0; k < leaving.size(); ++k) bed_.solid.unlock(leaving[k], masses[k]);
  for (const std::int64_t tag : leaving) bed_.solid.leave_rank(tag);
  bed_.split_bodies();
}

bool Handover::send_home() {
  bed_.arrivals.clear();
  if (bed_.ranks.count == 1) return false;
  std::vector<std::int64_t> atoms;
  for (int i = 0; i < bed_.atoms.owned; ++i) {
    if (!bed_.shell[i].locked || bed_.ranks.owns(bed_.atoms.place(i))) continue;
    if (bed_.run.keeps(bed_.atoms.place(i))) atoms.push_back(bed_.atoms.tag[i]);  // else the engine drops it on the way
  }
  std::sort(atoms.begin(), atoms.end());
  const std::vector<std::int64_t> stored = stored_elsewhere();
  if (!bed_.ranks.any(!atoms.empty() || !stored.empty())) return false;
  const std::vector<double> numbers = bed_.ranks.gather(parcels_.pack(stored, atoms));
  leave(atoms, stored);
  parcels_.take_up(parcels_.unpack(numbers.data(), numbers.size(), bed_.solid.contacts().width()));
  return true;
}

std::vector<LostGranule> Handover::take_over() {
  for (int i = 0; i < bed_.atoms.owned; ++i) {
    if (!bed_.shell[i].locked || bed_.shell[i].body != Locked::arriving) continue;
    const std::int64_t tag = bed_.atoms.tag[i];
    const Arrival* a = bed_.arrivals.find(tag);
    if (!a) throw InternalError("interface granule " + std::to_string(tag) + " came from another rank without its body");
    bed_.shell.arrives(i, a->at);
    bed_.shell.label(i, bed_.groups.key_of(a->at.body));
    bed_.arrivals.erase(tag);
  }
  std::vector<LostGranule> lost;
  bed_.arrivals.for_each([&](std::int64_t tag, const Arrival& a) {
    lost.push_back({tag, {a.mass, a.at.position, a.radius, a.held}});
  });
  std::sort(lost.begin(), lost.end(), [](const LostGranule& a, const LostGranule& b) { return a.tag < b.tag; });
  bed_.arrivals.clear();
  return lost;
}

}  // namespace solidcull
