#include "handover.h"

#include <algorithm>

#include "body_changes.h"

namespace solidcull {

void Handover::merged(int gone, int kept, bool same_frame) {
  at_home_.erase(gone);
  if (!same_frame) at_home_.erase(kept);
}

/// A stored one may lag behind by the slack: bodies that have not moved by it since they were last looked through are left.
std::vector<std::int64_t> Handover::stored_elsewhere() {
  std::vector<std::int64_t> tags;
  solid_.store().for_each_frame([&](int frame, const Vec3& lo, const Vec3& hi) {
    const Pose& pose = solid_.pose_of_frame(frame);
    const auto then = at_home_.find(frame);
    if (then != at_home_.end() && largest_way(then->second, pose, lo, hi) < 0.5 * stored_.slack()) return;
    at_home_[frame] = pose;
    solid_.store().for_each_in_box(frame, lo, hi, [&](const Resident& g) {
      if (!ports_.ranks.owns(solid_.in_world(g))) tags.push_back(g.tag);
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
  for (const std::int64_t tag : leaving) masses.push_back(masses_(tag));
  for (const std::int64_t tag : atoms) shell_.leaves_rank(index_.at(tag));
  std::vector<double> record;
  for (const std::int64_t tag : stored) solid_.bring_back(tag, record);
  for (std::size_t k = 0; k < leaving.size(); ++k) solid_.unlock(leaving[k], masses[k]);
  for (const std::int64_t tag : leaving) solid_.leave_rank(tag);
  split_bodies(ports_.atoms, solid_, shell_, index_, masses_);
}

bool Handover::send_home() {
  arrivals_.clear();
  if (ports_.ranks.count == 1) return false;
  std::vector<std::int64_t> atoms;
  for (int i = 0; i < ports_.atoms.owned; ++i) {
    if (!shell_[i].locked || ports_.ranks.owns(ports_.atoms.place(i))) continue;
    if (ports_.run.keeps(ports_.atoms.place(i))) atoms.push_back(ports_.atoms.tag[i]);  // else the engine drops it on the way
  }
  std::sort(atoms.begin(), atoms.end());
  const std::vector<std::int64_t> stored = stored_elsewhere();
  if (!ports_.ranks.any(!atoms.empty() || !stored.empty())) return false;
  const std::vector<double> numbers = ports_.ranks.gather(parcels_.pack(stored, atoms));
  leave(atoms, stored);
  parcels_.take_up(parcels_.unpack(numbers.data(), numbers.size(), solid_.contacts().width()));
  return true;
}

std::vector<LostGranule> Handover::take_over() {
  for (int i = 0; i < ports_.atoms.owned; ++i) {
    if (!shell_[i].locked || shell_[i].body != Locked::arriving) continue;
    const std::int64_t tag = ports_.atoms.tag[i];
    const Arrival* a = arrivals_.find(tag);
    if (!a) throw InternalError("interface granule " + std::to_string(tag) + " came from another rank without its body");
    shell_.arrives(i, a->at);
    shell_.label(i, groups_.key_of(a->at.body));
    arrivals_.erase(tag);
  }
  std::vector<LostGranule> lost;
  arrivals_.for_each([&](std::int64_t tag, const Arrival& a) {
    lost.push_back({tag, {a.mass, a.at.position, a.radius, a.held}});
  });
  std::sort(lost.begin(), lost.end(), [](const LostGranule& a, const LostGranule& b) { return a.tag < b.tag; });
  arrivals_.clear();
  return lost;
}

}  // namespace solidcull
