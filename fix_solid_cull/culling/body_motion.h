// How solid bodies move, in step with the engine's integrator (theory.md#body-integrator).
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "bed.h"

namespace solidcull {

/// A body that something is to be computed for: all but those that sleep on the ground and have no atoms. World frame.
struct ActiveBody {
  int number;
  SolidBody* body;
  bool stands = false;         ///< grounded
  Vec3 change = Vec3::Zero();  ///< if it stands: what its walls must bear beyond what is frozen, for it is in balance (N)
  Vec3 force = Vec3::Zero();   ///< if it does not: on the whole body (N)
  Vec3 torque = Vec3::Zero();  ///< and about its centre of mass (N m)
  double reach = 0;            ///< of its interior granules: farthest from the centre (m)
  double way = 0;              ///< bound of their way since the last reneighbouring (m)
  int spanning = -1;           ///< see BodyGroups::spanning
};

/// The bodies' loads, momentum and places, and the interface granules that ride on them.
class BodyMotion : public BodyFollower {
 public:
  explicit BodyMotion(Bed& bed) : bed_(bed) {}

  const std::vector<ActiveBody>& active() const { return active_; }
  /// Atom indices of the interface granules, since the last refresh(); number k stands in active()[slot(k)].
  const std::vector<int>& interface_atoms() const { return atoms_; }
  std::size_t slot(std::size_t k) const { return slot_[k]; }
  /// Largest load change over tolerance in this step, on this rank.
  double largest_excess() const { return largest_excess_; }

  /// The engine has searched for neighbours: what is near what is known, wherever bodies have been since the last time. Local.
  void begin_lists() {
    stale_ = true;
    tell_next();
  }
  /// What presses on bodies that stand is summed over their ranks in the next step: all ranks say so alike. Else it is taken to
  /// be what it was, but for what differs_from_told(). Local.
  void tell_next() { tells_ = true; }
  /// In this step, on this rank: by more than a hundredth of a granule's weight. Local.
  bool differs_from_told() const { return differs_; }
  /// Whether bodies or their atoms are others since they were listed. Local.
  bool stale() const { return stale_ || listed_ != bed_.shell.version(); }
  void merged(int, int, bool) override { stale_ = true; }
  void settled() override { stale_ = true; }
  void grounded_or_let_go(int) override { stale_ = true; }
  void frame_changed(int) override { stale_ = true; }
  void forgotten(int) override { stale_ = true; }
  /// Lists active bodies and their atoms, if they are stale. Local.
  void refresh();
  /// The same in the middle of a time step, between the loads and the second half of the kick: bodies that go on moving keep the
  /// loads that were taken, and the way that they have gone. Local.
  void refresh_in_step();

  // --- a time step
  /// Half a kick, and places. Local.
  void kick_and_drift();
  /// Interface granules go where their body is. Local.
  void place();
  /// Takes the contact forces off the interface granules, and sums them over bodies. Among the ranks of bodies that span some.
  void take_loads();
  /// The other half of the kick. Local.
  void kick();
  /// Interface granules that ride on moving bodies have their bodies' velocity field; all of them. Local.
  void give_velocities_to_riders();
  void give_velocities();

  /// Whether a stored granule may have gone so far that something unseen is near: within so many steps from now. Local.
  bool comes_too_far(int steps) const;

  void release_memory();

 private:
  struct FieldInFrame;
  std::vector<FieldInFrame> fields() const;
  void give_velocity(std::size_t k, const std::vector<FieldInFrame>& of);
  void add_to_body(std::size_t k, const Vec3& contact, const Vec3& torque);
  void list_clumps();
  void take_loads_of_clumps();
  void sum_over_ranks();
  [[noreturn]] void stop_at(const ActiveBody& a) const;
  double way_in_a_step(const ActiveBody& a) const;

  Bed& bed_;
  std::vector<ActiveBody> active_;
  std::vector<int> atoms_;           // indices of interface granules
  std::vector<std::size_t> slot_;    // their bodies in active_
  std::vector<Vec3> place_;          // and places there
  std::vector<std::size_t> riding_;  // those of them whose bodies move
  struct ClumpHere {
    std::vector<int> atoms;  // indices of its spheres
    double share;            // of all its spheres
  };
  std::vector<ClumpHere> clumps_;
  bool stale_ = true;
  struct Told {
    Vec3 here = Vec3::Zero(), all = Vec3::Zero();  // what pressed on a body that stands: on this rank, and on all
  };
  std::vector<Told> told_;  // when ranks told each other last, by ActiveBody::spanning
  bool tells_ = true, differs_ = false;
  std::uint64_t listed_ = 0;  // version of the shell then
  double largest_excess_ = 0;
};

}  // namespace solidcull
