// Clumps whose spheres are interface granules: the engine knows the spheres only, and the sphere that has the clump's mass keeps
// the rest (theory.md#clumps).
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "clump_numbers.h"
#include "per_granule.h"
#include "shell.h"

namespace solidcull {

/// By the tag of that sphere. While it stands in a body of this rank the clump lies in the frame of the body; on its way to
/// another rank, and as it comes from a file, in the world. Its motion is that which it had when it was locked. Local.
class LockedClumps : public FollowsAtoms {
 public:
  LockedClumps(const Atoms& atoms, const Clumps& clumps, const Shell& shell, const SolidBodies& bodies)
      : atoms_(atoms), clumps_(clumps), shell_(shell), bodies_(bodies) {}

  const Clump* find(std::int64_t tag) const {
    const auto found = all_.find(tag);
    return found == all_.end() ? nullptr : &found->second;
  }
  void put(std::int64_t tag, Clump clump) { all_[tag] = std::move(clump); }
  Clump take(std::int64_t tag) { return std::move(all_.extract(tag).mapped()); }
  const std::map<std::int64_t, Clump>& all() const { return all_; }
  template <class IsThere>
  void forget_all_but(IsThere is_there) {
    for (auto c = all_.begin(); c != all_.end();) c = is_there(c->first) ? std::next(c) : all_.erase(c);
  }

  void to_world(std::int64_t tag, const Pose& pose) {
    change(tag, [&](ClumpMass& lies) { lies.to_world(pose); });
  }
  void to_frame(std::int64_t tag, const Pose& pose) {
    change(tag, [&](ClumpMass& lies) { lies.to_frame(pose); });
  }
  void reframe(std::int64_t tag, const Pose& from, const Pose& to) {
    change(tag, [&](ClumpMass& lies) { lies.reframe(from, to); });
  }
  /// The sphere stands elsewhere in its body.
  void shift(std::int64_t tag, const Vec3& by) {
    change(tag, [&](ClumpMass& lies) { lies.move(by); });
  }

  void grow(int) override {}
  void copy(int, int) override {}
  void reset(int) override {}
  void fit(int) override {}
  int packed_size() const override { return clumps_.possible ? 1 + clump_numbers + clumps_.rest_size : 0; }
  void pack(int i, double* to) const override {
    const int size = packed_size();
    if (size == 0) return;
    std::fill_n(to, size, 0.0);
    const Clump* const known = shell_.locked(i) ? find(atoms_.tag[i]) : nullptr;
    if (!known) return;
    Clump c = *known;
    if (shell_[i].in_body()) c.lies = c.lies.in_world(bodies_.pose(shell_[i].body));
    c.rest.resize(std::min(c.rest.size(), static_cast<std::size_t>(clumps_.rest_size)));
    std::vector<double> numbers;
    solidcull::pack(c, numbers);
    to[0] = static_cast<double>(1 + c.rest.size());  // columns may have come since it was locked
    std::copy(numbers.begin(), numbers.end(), to + 1);
  }
  void unpack(int i, const double* from) override {
    if (packed_size() > 0 && from[0] != 0) put(atoms_.tag[i], unpack_clump(from + 1, static_cast<std::size_t>(from[0]) - 1));
  }

 private:
  template <class Change>
  void change(std::int64_t tag, Change change) {
    const auto found = all_.find(tag);
    if (found != all_.end()) change(found->second.lies);
  }

  const Atoms& atoms_;
  const Clumps& clumps_;
  const Shell& shell_;
  const SolidBodies& bodies_;
  std::map<std::int64_t, Clump> all_;
};

}  // namespace solidcull
