// The shell: interface granules, which are still atoms but locked to their body (theory.md#locking).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "granule_store.h"
#include "per_granule.h"
#include "ports.h"
#include "pose.h"
#include "solid_bodies.h"

namespace solidcull {

/// An interface granule; of an exterior one, what it was when it was locked last.
struct Locked {
  static constexpr double not_known = -1;
  static constexpr int arriving = -1;
  static constexpr int some_lost = 0;  ///< of a clump's spheres, so that the others are to wake

  bool locked = false;
  bool fresh = false;               ///< the reference load is taken in this step
  bool held = false;                ///< touched a wall that stands still when it was locked
  int body = 0;                     ///< the body in whose frame it stands, on this rank; `arriving`: to be taken over
  Vec3 place = Vec3::Zero();        ///< in the body's frame (m)
  Vec3 reference = Vec3::Zero();    ///< F_ext at locking, re-based when contacts change sides; frame of the body (N)
  Vec3 load_change = Vec3::Zero();  ///< F_ext - reference at the last step; frame of the body (N)
  double normal_load = not_known;   ///< sum of normal contact forces at locking (N)
  double excess = 0;                ///< largest load change over tolerance since it was last asked
  std::int64_t lock_step = -1;
  std::int64_t came_back = -1;                        ///< step in which it came out of the store
  int clump = 0, spheres = 0;                         ///< number of the clump that it is a sphere of, and of how many, or
                                                      ///< `some_lost`; clump 0: none
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();  ///< at locking, given back only if no step has passed

  bool in_body() const { return locked && body > 0; }

  static constexpr int packed_size = 20;
  void pack(double* to) const {
    const double values[packed_size] = {double(locked), double(fresh),     double(held),   reference[0],   reference[1],
                                        reference[2],   load_change[0],    load_change[1], load_change[2], normal_load,
                                        excess,         double(lock_step), velocity[0],    velocity[1],    velocity[2],
                                        spin[0],        spin[1],           spin[2],        double(clump),  double(spheres)};
    std::copy_n(values, packed_size, to);
  }
  static Locked unpack(const double* v) {
    Locked l;
    l.locked = v[0] != 0;
    l.fresh = v[1] != 0;
    l.held = v[2] != 0;
    l.reference = vec(v + 3);
    l.load_change = vec(v + 6);
    l.normal_load = v[9];
    l.excess = v[10];
    l.lock_step = static_cast<std::int64_t>(v[11]);
    l.velocity = vec(v + 12);
    l.spin = vec(v + 15);
    l.clump = static_cast<int>(v[18]);
    l.spheres = static_cast<int>(v[19]);
    return l;
  }
};

/// State of the interface granules by atom index, and the number of its body on all ranks for each atom. Loads are packed as they
/// are in the world: the body's frame stays behind, and body and place are given anew where the granule arrives. Local.
class Shell : public FollowsAtoms {
 public:
  explicit Shell(const SolidBodies& bodies) : bodies_(bodies) {}

  const Locked& operator[](int i) const { return rows_[i]; }
  bool locked(int i) const { return rows_[i].locked; }
  /// Another number whenever it may be others that are locked, other atoms, or other places in bodies.
  std::uint64_t version() const { return version_; }

  /// Owned atom i is locked in this step, with the motion that it has; `normal_load`: what its contacts press with (N).
  void lock(Atoms& atoms, int i, std::int64_t step, double normal_load, bool held) {
    Locked& e = changed(i);
    e.clump = e.spheres = 0;
    e.locked = e.fresh = true;
    e.load_change = Vec3::Zero();
    e.normal_load = normal_load;
    e.excess = 0;
    e.held = held;
    e.lock_step = step;
    e.velocity = atoms.velocity(i);
    e.spin = atoms.spin(i);
    atoms.mark_interface(i, true);
  }
  /// It will be exterior; what its body must know of it stays until left_body().
  void unlock(Atoms& atoms, int i) {
    Locked& e = changed(i);
    e.locked = e.fresh = false;
    e.excess = 0;
    e.normal_load = Locked::not_known;
    atoms.mark_interface(i, false);
    labels_[i] = 0;
  }
  /// It is a sphere of this clump, of so many.
  void set_clump(int i, int number, int spheres) {
    rows_[i].clump = number;
    rows_[i].spheres = spheres;
  }
  void left_body(int i) {
    Locked& e = changed(i);
    e.clump = e.spheres = 0;
    e.lock_step = -1;
    e.body = 0;
    e.held = false;
  }
  /// Out of the store, as atom i, in this step. `lock_step`: see StoreExchange.
  void came_back(Atoms& atoms, int i, const StoredGranule& g, std::int64_t lock_step, std::int64_t step) {
    Locked& e = changed(i);
    e = Locked();
    e.locked = e.fresh = true;
    e.body = g.body;
    e.place = g.position;
    e.load_change = g.load_change;
    e.normal_load = g.normal_load;
    e.held = g.held;
    e.clump = g.clump;
    e.spheres = g.spheres;
    e.came_back = step;
    e.lock_step = lock_step;
    e.velocity = atoms.velocity(i);
    e.spin = atoms.spin(i);
  }

  /// As it was, on this rank.
  void put(int i, const Locked& e) { changed(i) = e; }
  /// Body and place, as locking gives them, or as they are after a split or a merge.
  void set_place(int i, const SolidBodies::Place& at) {
    Locked& e = changed(i);
    e.body = at.body;
    e.place = at.position;
  }
  /// The same granule seen from another frame of its body.
  void reframe(int i, const Pose& from, const Pose& to) {
    Locked& e = changed(i);
    e.place = to.to_frame(from.to_world(e.place));
    e.reference = to.turned_to_frame(from.turned_to_world(e.reference));
    e.load_change = to.turned_to_frame(from.turned_to_world(e.load_change));
  }
  void set_body(int i, int body) { changed(i).body = body; }
  /// The frame becomes the world's.
  void to_world_frame(int i, const Pose& pose) {
    Locked& e = changed(i);
    e.place = pose.to_world(e.place);
    loads_to_world(e, pose);
  }
  /// It goes to another rank: its loads are the world's until it is taken over there.
  void leaves_rank(int i) {
    Locked& e = changed(i);
    loads_to_world(e, bodies_.pose(e.body));
    e.body = Locked::arriving;
  }
  /// The engine brought it from another rank.
  void mark_arriving(int i) {
    if (rows_[i].locked) changed(i).body = Locked::arriving;
  }
  /// It has come from another rank or a file: loads turn from the world to the frame of its body.
  void arrives(int i, const SolidBodies::Place& at) {
    Locked& e = rows_[i];
    const Pose& pose = bodies_.pose(at.body);
    set_place(i, at);
    e.reference = pose.turned_to_frame(e.reference);
    e.load_change = pose.turned_to_frame(e.load_change);
  }

  /// A contact has changed sides: this load (world frame, N) is no change for the granule (invariant I5).
  void rebase(int i, const Vec3& by) { rows_[i].reference += bodies_.pose(rows_[i].body).turned_to_frame(by); }
  /// The load on it in this step, in the frame of its body (N); returns the largest load change over `tolerance` that it has had.
  double take_load(int i, const Vec3& load, double tolerance) {
    Locked& e = rows_[i];
    if (e.fresh) {
      e.reference = load - e.load_change;
      e.fresh = false;
    }
    e.load_change = load - e.reference;
    const double square = e.load_change.squaredNorm();
    if (square > e.excess * e.excess * tolerance * tolerance) e.excess = std::sqrt(square) / tolerance;
    return e.excess;
  }
  /// What its granule as a whole has had, if that is more.
  void raise_excess(int i, double excess) { rows_[i].excess = std::max(rows_[i].excess, excess); }
  double take_excess(int i) {
    const double excess = rows_[i].excess;
    rows_[i].excess = 0;
    return excess;
  }

  /// Number of its body over all ranks, 0 of an exterior granule: what f_ID shows of atom i.
  void label(int i, std::int64_t key) { labels_[i] = static_cast<double>(key); }
  double* labels() { return labels_.data(); }
  const double* labels() const { return labels_.data(); }

  void grow(int room) override {
    rows_.grow(room);
    labels_.resize(static_cast<std::size_t>(room));
  }
  void copy(int from, int to) override {
    ++version_;
    rows_.copy(from, to);
    labels_[to] = labels_[from];
  }
  void reset(int i) override {
    ++version_;
    rows_.reset(i);
    labels_[i] = 0;
  }
  int packed_size() const override { return rows_.packed_size(); }
  void pack(int i, double* to) const override {
    Locked e = rows_[i];
    if (e.in_body()) loads_to_world(e, bodies_.pose(e.body));
    e.pack(to);
  }
  /// What comes from another rank is to be taken over; what comes from a file has no body yet.
  void unpack(int i, const double* from) override {
    ++version_;
    rows_.unpack(i, from);
    labels_[i] = 0;
  }
  void fit(int room) override {
    rows_.fit(room);
    labels_.resize(static_cast<std::size_t>(room));
    labels_.shrink_to_fit();
  }
  std::size_t bytes() const { return rows_.bytes(); }

 private:
  Locked& changed(int i) {
    ++version_;
    return rows_[i];
  }
  static void loads_to_world(Locked& e, const Pose& pose) {
    e.reference = pose.turned_to_world(e.reference);
    e.load_change = pose.turned_to_world(e.load_change);
  }

  const SolidBodies& bodies_;
  PerGranule<Locked> rows_;
  std::uint64_t version_ = 0;
  std::vector<double> labels_;
};

}  // namespace solidcull
