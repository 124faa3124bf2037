#include "frozen_wall_loads.h"

#include <algorithm>
#include <cmath>

namespace solidcull {

void FrozenWallLoads::book(int body, const WallLoad& load, int sign) {
  Sums& sums = sign > 0 ? bodies_[body] : bodies_.at(body);  // what is taken away must have been there
  book(sums.elements, load, sign);
  sums.changed();
  if (sums.elements.empty()) bodies_.erase(body);
  book(all_, load, sign);
  on_meshes_known_ = false;
}

void FrozenWallLoads::book(Elements& elements, const WallLoad& load, int sign) {
  Element& e = sign > 0 ? elements[{load.mesh, load.element}] : elements.at({load.mesh, load.element});
  e.granules += sign;
  e.force += sign * load.force;
  e.torque += sign * load.torque;
  if (e.granules == 0) elements.erase({load.mesh, load.element});  // with it what rounding has left
}

void FrozenWallLoads::add(std::int64_t tag, int body, const std::vector<WallLoad>& loads) {
  for (const WallLoad& load : loads) {
    int e = free_;
    if (e == none) {
      e = static_cast<int>(entries_.size());
      entries_.emplace_back();
    } else {
      free_ = entries_[e].next;
    }
    int* head = heads_.find(tag);
    entries_[e] = {load, head ? *head : none};
    heads_[tag] = e;
    book(body, load, +1);
  }
}

void FrozenWallLoads::erase(std::int64_t tag, int body) {
  const int* head = heads_.find(tag);
  if (!head) return;
  for (int e = *head; e != none;) {
    book(body, entries_[e].load, -1);
    const int next = entries_[e].next;
    entries_[e].next = free_;
    free_ = e;
    e = next;
  }
  heads_.erase(tag);
}

void FrozenWallLoads::move(std::int64_t tag, int from, int to) {
  const int* head = heads_.find(tag);
  if (!head || from == to) return;
  for (int e = *head; e != none; e = entries_[e].next) {
    book(from, entries_[e].load, -1);
    book(to, entries_[e].load, +1);
  }
}

void FrozenWallLoads::merge(int swallowed, int kept) {
  const auto from = bodies_.find(swallowed);
  if (from == bodies_.end()) return;
  Sums& to = bodies_[kept];
  to.changed();
  for (const auto& element : from->second.elements) {
    Element& e = to.elements[element.first];
    e.granules += element.second.granules;
    e.force += element.second.force;
    e.torque += element.second.torque;
  }
  bodies_.erase(swallowed);
}

void FrozenWallLoads::clear() { *this = FrozenWallLoads(); }

const Vec3& FrozenWallLoads::force(int body) const {
  static const Vec3 none = Vec3::Zero();
  const auto found = bodies_.find(body);
  if (found == bodies_.end()) return none;
  const Sums& sums = found->second;
  if (sums.force_known) return sums.force;
  sums.force = Vec3::Zero();
  for (const auto& e : sums.elements) sums.force += e.second.force;
  sums.force_known = true;
  return sums.force;
}

auto FrozenWallLoads::bearing(int body) const -> const std::vector<Bearing>& {
  static const std::vector<Bearing> none;
  const auto found = bodies_.find(body);
  if (found == bodies_.end()) return none;
  const Sums& sums = found->second;
  if (sums.bearing_known) return sums.bearing;
  sums.bearing.clear();
  for (const auto& [place, e] : sums.elements)
    if (place.first != WallLoad::no_mesh && e.share > 0)
      sums.bearing.push_back({place, e.share, e.force.cross(e.torque) / e.force.squaredNorm()});
  sums.bearing_known = true;
  return sums.bearing;
}

auto FrozenWallLoads::on_meshes() const -> const std::vector<OnMesh>& {
  if (on_meshes_known_) return on_meshes_;
  on_meshes_.clear();
  for (const auto& [place, e] : all_)
    if (place.first != WallLoad::no_mesh) on_meshes_.push_back({place, e.force, e.torque});
  on_meshes_known_ = true;
  return on_meshes_;
}

double FrozenWallLoads::weigh(int body, const Vec3& load) {
  double sum = 0;
  const auto found = bodies_.find(body);
  if (found == bodies_.end()) return sum;
  found->second.bearing_known = false;
  for (auto& e : found->second.elements) sum += e.second.share = std::abs(e.second.force.dot(load));
  return sum;
}

void FrozenWallLoads::share_out(int body, double sum) {
  const auto found = bodies_.find(body);
  if (found == bodies_.end()) return;
  found->second.bearing_known = false;
  for (auto& e : found->second.elements) e.second.share = sum > 0 ? e.second.share / sum : 0.0;
}

std::size_t FrozenWallLoads::memory_bytes() const {
  std::size_t bytes = entries_.capacity() * sizeof(Entry) + heads_.memory_bytes();
  for (const auto& body : bodies_)
    bytes +=
        body.second.elements.size() * (sizeof(Element) + sizeof(Place) + 32) + body.second.bearing.capacity() * sizeof(Bearing);
  return bytes;
}

}  // namespace solidcull
