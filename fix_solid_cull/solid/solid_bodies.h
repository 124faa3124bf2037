// Solid bodies: connected groups of locked granules, each one rigid body with its granules' mass properties
// (theory.md#solid-bodies).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "clump_mass.h"
#include "flat_map.h"
#include "frozen_contacts.h"
#include "pose.h"
#include "rigid_motion.h"
#include "sphere.h"

namespace solidcull {

/// A locked granule, in the frame of its body. Of a clump, one sphere has all that the clump weighs, and the others nothing.
struct GranuleMass {
  double mass;
  Vec3 position;
  double radius;
  bool held = false;                              ///< it touches a wall that stands still
  std::optional<ClumpMass> clump = std::nullopt;  ///< it has the mass of a clump
};

/// A sphere that is to be locked, or is given back with this motion: of its centre, or of the centre of mass of the clump whose
/// mass it has. World frame.
struct MovingGranule {
  double mass, radius;
  Vec3 position, velocity, spin;
  bool held = false;                              ///< it touches a wall that stands still
  std::optional<ClumpMass> clump = std::nullopt;  ///< it has the mass of a clump
};

/// Sums over granules that are added and taken away as granules come and go. SI units, body frame, about a point in the body, so
/// that nothing is lost to a far origin.
struct MassProperties {
  std::int64_t count = 0;                            ///< spheres
  std::int64_t weighing = 0;                         ///< those of them that have mass
  Vec3 about = Vec3::Zero();                         ///< the point: where the first granule was (m)
  double mass = 0;                                   ///< kg
  Vec3 first = Vec3::Zero();                         ///< sum of m (x - about)
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();  ///< sum of m (x - about) (x - about)^T
  double spin = 0;                                   ///< sum of 2/5 m r^2, each granule's own inertia
  std::int64_t held = 0;                             ///< granules that touch a wall that stands still

  /// turning_radius: see SolidBodies.
  void add(const GranuleMass& granule, double turning_radius, int sign = 1);
  void add(const MassProperties& other, int sign = 1);
  Vec3 centre() const { return weighing > 0 ? Vec3(about + first / mass) : about; }  ///< m
  Eigen::Matrix3d inertia() const;                                                   ///< about the centre of mass, kg m^2
  MassProperties seen_from(const Pose& here, const Pose& there) const;               ///< the same granules in another frame

 private:
  void drop_rounding();
};

struct SolidBody {
  Pose pose;
  MassProperties mass;          ///< frame of the body; of this rank's part
  Twist twist;                  ///< its velocity field
  RigidMotion motion;           ///< of the whole body, over all ranks; current after the adapter has settled it
  bool changed = true;          ///< since its motion was last settled
  bool spanned = false;         ///< a part of a body over several ranks when its motion was last settled
  std::array<bool, 3> spans{};  ///< tied to its own periodic image in these directions
  std::int64_t summed = 0;      ///< count when the sums were last made from scratch
  // what it feels (theory.md#effective-gravity)
  Vec3 felt = Vec3::Zero();  ///< effective gravity at locking, frame of the body (m/s^2)
  bool felt_known = false;
  Vec3 velocity_then = Vec3::Zero();  ///< of the centre, when the window of the mean acceleration began (m/s)
  std::int64_t step_then = -1;
  Vec3 acceleration = Vec3::Zero();  ///< mean over the last window (m/s^2)
  /// It stands still: what it is given goes to the ground. A body that merges with a grounded one is grounded; of the parts of a
  /// grounded one those are that hold a granule that is held.
  bool grounded = false;
  double grounded_mass = 0;  ///< of what was grounded of itself, not by merging with what was (kg)
  /// Since it was grounded or let go the last time: looks in a row at rest at a wall that stands still; the running mean of what
  /// its walls bear beyond what is frozen, once it was pressed on (N).
  std::int64_t looks_at_rest = 0;
  bool pressed = false;
  Vec3 extra_load = Vec3::Zero();

  /// Calls visit(number) with a reference to each number of the state, in one order: to write it to a file and to read it back.
  template <class Visit>
  void each_number(Visit visit) {
    const auto vector = [&](Vec3& v) {
      for (int d = 0; d < 3; ++d) visit(v[d]);
    };
    Vec3 origin = pose.origin();
    Eigen::Quaterniond turn = pose.quaternion();
    vector(origin);
    for (int k = 0; k < 4; ++k) visit(turn.coeffs()[k]);
    pose = Pose(origin, turn);
    visit(mass.count);
    visit(mass.weighing);
    visit(mass.held);
    vector(mass.about);
    visit(mass.mass);
    vector(mass.first);
    for (int k = 0; k < 9; ++k) visit(mass.second.data()[k]);
    visit(mass.spin);
    vector(twist.point);
    vector(twist.velocity);
    vector(twist.spin);
    motion.each_number(visit);
    visit(changed);
    visit(spanned);
    for (bool& s : spans) visit(s);
    visit(summed);
    vector(felt);
    visit(felt_known);
    vector(velocity_then);
    visit(step_then);
    vector(acceleration);
    visit(grounded);
    visit(grounded_mass);
    visit(looks_at_rest);
    visit(pressed);
    vector(extra_load);
  }

  bool is_one_sphere() const { return mass.count == 1 && !spanned; }
  RigidPart part() const;  ///< this rank's part, world frame
  FreeAxes free_axes() const { return free_axes(spans); }
  static FreeAxes free_axes(const std::array<bool, 3>& spans);

  /// Walls hold it from now on, or do no longer. It stands still; a sphere may go on spinning on the spot.
  void ground(bool on);
  /// A granule of this mass (kg) came into it that was of a grounded body elsewhere: it stands too.
  void stand_as(const SolidBody& from, double granule_mass);
  void begin_to_rest();  ///< what is counted and summed since it was grounded or let go
  /// How many looks in a row it has rested now.
  std::int64_t rests(bool at_rest) { return looks_at_rest = at_rest ? looks_at_rest + 1 : 0; }
  /// What its walls bear in this step beyond what is frozen (N).
  void bear(const Vec3& extra, int steps_of_mean) {
    pressed = true;
    extra_load += (extra - extra_load) / steps_of_mean;
  }
  /// A body of one sphere, which stands at this place of the world: its frame becomes the world's.
  void reframe_one(const GranuleMass& in_world, double turning_radius);
  /// How many granules the whole is, over all ranks.
  double granules() const {
    return mass.weighing > 0 ? motion.mass() * static_cast<double>(mass.count) / mass.mass : static_cast<double>(mass.count);
  }

  // one time step (theory.md#body-integrator)
  void kick(const Vec3& force, const Vec3& torque, double dt) { motion.kick(force, torque, dt); }
  void drift(double dt) { pose.advance(motion.drift(dt)); }
  void shift(const Vec3& by) {  ///< to another periodic image
    pose.shift(by);
    motion.shift(by);
  }
  void take_twist() { twist = motion.twist(); }

  // after its granules changed
  /// Whether it is a part of a body over several ranks now; where that is new its motion is to be settled, and the window of its
  /// mean acceleration begins anew.
  void note_span(bool spans_ranks) {
    if (spanned == spans_ranks) return;
    spanned = spans_ranks;
    changed = true;
    step_then = -1;
  }
  void settle();  ///< its own granules are all there is
  /// It is a part of this whole, `grounded_share` of which was grounded of itself; shift: from this rank's image to the one in
  /// which the whole is given.
  void settle_as_part(const RigidSum& whole, const FreeAxes& free, const Vec3& shift, double grounded_share);

  // effective gravity (theory.md#effective-gravity)
  void feel(const Vec3& gravity_in_frame) {
    felt = gravity_in_frame;
    felt_known = true;
  }
  void feel_first(const Vec3& gravity_in_frame) {
    if (!felt_known) feel(gravity_in_frame);
  }
  /// What `from`, a body elsewhere with a granule that has come into this one, felt.
  void feel_as(const SolidBody& from);
  void begin_window(std::int64_t step) {
    velocity_then = motion.velocity();
    step_then = step;
  }
  void end_window(double seconds) { acceleration = (motion.velocity() - velocity_then) / seconds; }
};

/// Which locked granule belongs to which body, and how the bodies move. Bodies are numbered from 1; numbers are not used again.
/// Local to the rank: a body that spans ranks has a number on each; all its parts share one motion, which the adapter unites.
class SolidBodies {
 public:
  /// Mass and place of a locked granule, by tag, in the frame of its present body.
  using MassOf = std::function<GranuleMass(std::int64_t)>;

  /// Contacts turn granules, as they do unless this says otherwise; where they do not, a granule is a point to its body. Not
  /// while granules are locked.
  void set_granules_turn(bool on) { granules_turn_ = on; }
  bool granules_turn() const { return granules_turn_; }
  /// Radius (m) with which a granule takes part in the turning of its body. Where no contact turns it, it is nearly a point: what
  /// it has of inertia is far below that of two granules side by side, and far above what rounding leaves of none.
  double turning_radius(double radius) const { return granules_turn_ ? radius : 1e-3 * radius; }

  /// As its body takes it up.
  RigidPart part_of(const MovingGranule& granule) const;

  /// Edges of the periodic box, 0 where it is not periodic (m).
  void set_periods(const Vec3& periods) { periods_ = periods; }
  const Vec3& periods() const { return periods_; }
  /// The periodic image of x that is nearest to the place `to`.
  Vec3 nearest_image(const Vec3& x, const Vec3& to) const;

  /// A granule is locked: it joins the bodies of its frozen contacts (which merge if they were several), or founds one.
  /// Momentum and angular momentum are kept, but for what a grounded body is given.
  struct Place {
    int body = 0;
    Vec3 position = Vec3::Zero();  ///< frame of the body (m)
  };
  Place lock(std::int64_t tag, const MovingGranule& granule, const FrozenContacts& contacts, const MassOf& mass_of);

  /// Names the body (or one that it swallowed) of a granule that leave() gave away, 0 of any other.
  using BodyElsewhere = std::function<int(std::int64_t)>;
  void set_elsewhere(BodyElsewhere body) { elsewhere_ = std::move(body); }
  /// It stays in its body, which is named from elsewhere from here on, until take_in().
  void leave(std::int64_t tag) { member_.erase(narrow_tag(tag)); }
  void fit() { member_.fit(); }

  /// One of its granules is somewhere else in it from here on, by so little that the motion stays what it is.
  void shift(int body, const GranuleMass& granule, const Vec3& to) {
    MassProperties& sums = this->body(body).mass;
    const double radius = turning_radius(granule.radius);
    GranuleMass there = granule;
    there.position = to;
    sums.add(there, radius, +1);
    sums.add(granule, radius, -1);
  }

  /// The same by any way: the body's centre keeps its velocity, and the body its spin. Its motion is to be settled.
  void relocate(int body, const GranuleMass& granule, const Vec3& to) {
    SolidBody& b = this->body(body);
    const Vec3 velocity = b.twist.at(b.pose.to_world(b.mass.centre()));
    shift(body, granule, to);
    b.twist = {b.pose.to_world(b.mass.centre()), velocity, b.twist.spin};
    b.changed = true;
  }

  /// A body as it was (from a restart file), and a granule that was in it. Returns its number.
  int found(const SolidBody& body);
  void take_in(std::int64_t tag, int body) { member_[narrow_tag(tag)] = body; }

  /// Two locked granules are tied together by a contact that is frozen now: their bodies merge if they were two.
  void join(std::int64_t a, std::int64_t b, const MassOf& mass_of);

  /// A granule is unlocked and goes on with the body's own velocity field: the body's motion does not change (paper: it "chips
  /// off without affecting the momentum"). `given`: the granule goes on with a motion of its own instead, and the body keeps the
  /// rest of the momentum. Call before its contacts are erased; afterwards call split() once for all that were unlocked together.
  void unlock(std::int64_t tag, const GranuleMass& granule, const FrozenContacts& contacts, const MovingGranule* given = nullptr);

  /// Bodies that came apart through the unlock() calls since the last split() become several, each with the velocity field that
  /// they had. Searches all cut edges at once and stops when one search is left, so its cost goes with the smaller parts. Calls
  /// moved(tag, new body, place there) for each granule of a part that came off; the place is another one where the body was tied
  /// to its own periodic image and the part is not.
  void split(const FrozenContacts& contacts, const MassOf& mass_of,
             const std::function<void(std::int64_t, int, const Vec3&)>& moved);

  /// Bodies that lost a part in the last split().
  const std::vector<int>& split_parents() const { return split_parents_; }

  int body_of(std::int64_t tag) const;  ///< 0 if not locked on this rank
  /// std::exception for a number that no living body has.
  SolidBody& body(int number) { return const_cast<SolidBody&>(std::as_const(*this).body(number)); }
  const SolidBody& body(int number) const;
  /// Frame of a body, or of one that was swallowed and whose granules have not been moved yet.
  const Pose& pose(int number) const;
  std::map<int, SolidBody>& bodies() { return bodies_; }
  const std::map<int, SolidBody>& bodies() const { return bodies_; }
  std::size_t size() const { return bodies_.size(); }
  std::size_t locked() const { return member_.size(); }  ///< but for those that are known from elsewhere
  std::size_t member_bytes() const { return member_.memory_bytes(); }
  /// But for those that are known from elsewhere.
  template <class Visit>
  void for_each_member(Visit visit) const {
    member_.for_each([&](std::int64_t tag, int body) { visit(tag, root(body)); });
  }

  /// Swallowed bodies with the frames that they had; their granules' places must be moved to the frames of root(). Then forget
  /// them.
  const std::map<int, Pose>& swallowed() const { return swallowed_; }
  int root(int body) const;
  void forget_swallowed() { swallowed_.clear(); }

 private:
  int found();
  int merge(int a, int b, Vec3 shift);
  int tie(int a, Vec3& position_in_a, int b, const Vec3& position_in_b);
  bool is_member(std::int64_t tag) const { return member_.contains(narrow_tag(tag)) || (elsewhere_ && elsewhere_(tag)); }
  static void stand_still(SolidBody& body);
  static void add(SolidBody& body, const RigidPart& part);
  static void centre_moved(SolidBody& body, const Vec3& from);
  Vec3 to_image_of(const Vec3& there) const;  // shift that brings a distance to its shortest image
  void sum_anew(int number, std::int64_t member, const FrozenContacts& contacts, const MassOf& mass_of);

  Vec3 periods_ = Vec3::Zero();
  bool granules_turn_ = true;
  BodyElsewhere elsewhere_;
  FlatMap<int, std::int32_t> member_;   // tag -> body, to be resolved by root()
  mutable std::vector<int> parent_{0};  // union-find over body numbers; 0 is no body
  std::map<int, SolidBody> bodies_;     // living bodies only
  std::map<int, Pose> swallowed_;
  std::vector<std::int64_t> cut_;  // locked neighbours of unlocked granules
  std::vector<int> split_parents_;
};

}  // namespace solidcull
