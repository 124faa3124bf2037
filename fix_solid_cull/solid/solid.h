// Everything that is culled on this rank: bodies, the granule store, frozen contacts and wall loads, the ledger. The one class
// that changes them, and always together.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "frozen_contacts.h"
#include "frozen_wall_loads.h"
#include "granule_store.h"
#include "inner_contacts.h"
#include "ledger.h"
#include "scales.h"
#include "sites.h"
#include "solid_bodies.h"

namespace solidcull {

/// Whoever keeps something for each body follows what becomes of bodies. Called after the solid has changed. Local.
class BodyFollower {
 public:
  virtual ~BodyFollower() = default;
  /// `gone` was swallowed by `kept`; same_frame: its granules stand as they stood.
  virtual void merged(int /*gone*/, int /*kept*/, bool /*same_frame*/) {}
  /// This granule, which is no stored one, is of a part that came off: it stands at this place of its new body.
  virtual void came_off(std::int64_t /*tag*/, int /*body*/, const Vec3& /*place*/) {}
  /// Which parts of ranks are one body has been found anew, and motions follow from that.
  virtual void settled() {}
  virtual void grounded_or_let_go(int /*body*/) {}
  /// The frame of the body is another one now.
  virtual void frame_changed(int /*body*/) {}
  /// Its stored granules have left the grid that bodies share which stand still.
  virtual void left_shared_grid(int /*body*/) {}
  virtual void forgotten(int /*body*/) {}  ///< nothing of it is left
  /// One of its granules is, or was until now, at this place in its frame: it came, left, or stands elsewhere.
  virtual void granule_changed(int /*body*/, const Sphere& /*granule*/) {}
};

/// SI units. Local to the rank.
class Solid {
 public:
  using MassOf = SolidBodies::MassOf;

  explicit Solid(const Scales& scales) : scales_(scales) {}
  Solid(const Solid&) = delete;

  void followed_by(BodyFollower& follower) { followers_.push_back(&follower); }

  // --- the deck
  /// Search cells take their size from the scales, which are known by now.
  void open_store();
  bool has_store() const { return store_ != nullptr; }
  /// An exact store of fewer granules than this leaves their contacts in the graph: in so small a bed packing them costs time and
  /// saves next to nothing. 0: it packs all.
  void pack_contacts_from(std::size_t granules) { pack_from_ = granules; }
  /// Edges of the periodic box, 0 where it is not periodic (m).
  void set_periods(const Vec3& edges) { bodies_.set_periods(edges); }
  /// Layout of the contact histories: which change sign with the side, which are vectors. False, and nothing happens, if another
  /// layout is in use.
  bool set_histories(const std::vector<bool>& flips, const std::vector<int>& vectors);
  /// Whether contacts turn granules. False, and nothing happens, if it was otherwise and granules are locked.
  bool set_granules_turn(bool on);
  /// A granule of this type and size is stored, or will be.
  void know_radius(int type, double radius);
  void set_types(int types) { largest_radius_by_type_.assign(static_cast<std::size_t>(types) + 1, 0.0); }

  // --- what there is
  const SolidBodies& bodies() const { return bodies_; }
  const GranuleStore& store() const { return *store_; }
  const FrozenContacts& contacts() const { return contacts_; }
  /// See FrozenContacts::review(). What was seen to have both ends here comes back when one of them leaves the rank.
  template <class Keep>
  void review_contacts(Keep keep) {
    contacts_.review(keep);
  }
  void begin_reviews() { contacts_.begin_reviews(); }
  const FrozenWallLoads& wall_loads() const { return wall_loads_; }
  const Ledger& ledger() const { return ledger_; }
  const std::vector<double>& largest_radius_by_type() const { return largest_radius_by_type_; }
  /// Granules that are locked here, interface and interior.
  std::size_t locked() const { return bodies_.locked() + store_->size(); }
  bool exists(int body) const { return bodies_.bodies().count(body) != 0; }
  /// Its granules at still walls may be stored.
  bool stands(int body) const { return bodies_.body(body).grounded; }
  /// It stands, and so do its stored granules where they were: what they and others that stand do to each other is known.
  bool stands_in_store(int body) const { return stands(body) && !sites_; }
  /// A body is in balance when what is left over is less than this share of its weight.
  static constexpr double balance_share = 0.002;
  /// The walls' frozen loads on this rank's stored granules of the body are in balance with its weight.
  bool walls_bear(int body, const Vec3& gravity) const {
    const double mass = bodies_.body(body).mass.mass;
    return (wall_loads_.force(body) + mass * gravity).norm() < balance_share * mass * scales_.gravity();
  }
  bool frame_stands(int frame) const { return frame == GranuleStore::shared_frame || stands(frame); }
  /// Of a frame of the store: that of its body, or the world.
  const Pose& pose_of_frame(int frame) const {
    static const Pose world;
    return frame == GranuleStore::shared_frame ? world : bodies_.pose(frame);
  }
  Vec3 in_world(const Resident& g) const { return bodies_.pose(g.body).to_world(g.position); }
  /// The periodic image of x that is nearest to the place `to`.
  Vec3 nearest_image(const Vec3& x, const Vec3& to) const { return bodies_.nearest_image(x, to); }
  double kinetic_energy(int body) const;
  /// Counts how often stored granules came to stand still in other ways than by being put away.
  int standing_version() const { return standing_version_; }
  /// All stored spheres of clumps of which some are named are named then, once or more.
  void add_rest_of_clumps(std::vector<std::int64_t>& tags) const;
  /// See StoredGranule::home().
  Vec3 home_of(std::int64_t tag) const;
  /// History of a contact between two stored granules that is not in the graph, as g sees it; false if it has none.
  bool inner_history(const Resident& g, std::int64_t partner, double* history) const {
    return inner_->history(g, partner, history);
  }

  // --- bodies
  SolidBodies::Place lock(std::int64_t tag, const MovingGranule& granule, const MassOf& mass_of) {
    const SolidBodies::Place at = bodies_.lock(tag, granule, contacts_, mass_of);
    changed(at.body, {at.position, granule.radius});
    return at;
  }
  void tie(std::int64_t a, std::int64_t b, const MassOf& mass_of) { bodies_.join(a, b, mass_of); }
  /// See SolidBodies::unlock.
  void unlock(std::int64_t tag, const GranuleMass& granule, const MovingGranule* given = nullptr) {
    changed(bodies_.body_of(tag), {granule.position, granule.radius});
    bodies_.unlock(tag, granule, contacts_, given);
  }
  /// After unlock(): bodies that came apart become several.
  void split(const MassOf& mass_of);
  /// After lock() and tie(): the stored granules of swallowed bodies move to the frames in which they are now; the interface
  /// granules' contacts were turned before, see turn_contacts().
  void adopt_swallowed();
  /// Histories of this granule's contacts turn with its frame; those shared with another member only once, by the lower tag.
  void turn_contacts(std::int64_t tag, const Eigen::Matrix3d& by);
  SolidBody& body(int number) { return bodies_.body(number); }
  std::map<int, SolidBody>& bodies_in_motion() { return bodies_.bodies(); }
  void ground(int body, bool on);
  /// A granule of this mass (kg) came into it that was of a body elsewhere: where that stood, this one stands.
  void stand_as(int body, const SolidBody& from, double mass);
  /// A grounded body of one granule, which is a sphere whatever way it is turned: the world's frame becomes its frame.
  void reframe_one(int body, const GranuleMass& in_world);
  /// Nothing is left of a body of this number.
  void forget(int body);

  // --- frozen contacts
  void freeze(std::int64_t tag, std::int64_t partner, const double* history_in_world) {
    contacts_.add_unturned(tag, partner, history_in_world);
  }
  void freeze_in_frame(std::int64_t tag, std::int64_t partner, const double* history) { contacts_.add(tag, partner, history); }
  /// Now that each granule has its body, histories are turned into the frames in which they wait.
  void turn_frozen();
  void thaw(std::int64_t tag) { contacts_.erase(tag); }
  /// Contacts of a granule that leaves for another rank; those with what stays are kept.
  void leave_rank(std::int64_t tag);

  // --- the store
  /// g as the store will hold it; what it moves by then is told to its body. With `store none` it takes the nearest free site.
  StoredGranule as_stored(const StoredGranule& g);
  /// An interface granule stands elsewhere in its body from here on (frame of the body).
  void relocate(int body, const GranuleMass& granule, const Vec3& to) {
    bodies_.relocate(body, granule, to);
    changed(body, {granule.position, granule.radius});
    changed(body, {to, granule.radius});
  }
  /// It stands in another body from here on, or in another frame of its own.
  void tell_granule(int body, const Sphere& granule) { changed(body, granule); }
  /// So many granules are about to be put away. If they are many beside what is stored, a bed comes to rest, and an exact store
  /// packs their contacts. Few are what a wave woke and will wake again: theirs stay in the graph. What is packed, or is not,
  /// stays so.
  void expects(std::size_t granules);
  void put_away(const StoredGranule& g, const std::vector<double>& record, const std::vector<int>& transient,
                const std::vector<WallLoad>& loads);
  /// It leaves the store and is an interface granule of its body again; `record` receives its engine record.
  StoredGranule bring_back(std::int64_t tag, std::vector<double>& record);
  /// Another engine record for a stored granule that is the same to the culling; see GranuleStore::set_record.
  void set_record(std::int64_t tag, int layout, const std::vector<double>& record, const std::vector<int>& transient) {
    store_->set_record(tag, layout, record, transient);
  }
  void forget_transient() { store_->forget_transient(); }

  // --- from a restart file or another rank; enter_store() once all contacts are there
  int found(const SolidBody& body);
  void take_in(std::int64_t tag, int body, const Sphere& granule) {
    bodies_.take_in(tag, body);
    changed(body, granule);
  }
  void add_stored(const StoredGranule& g, const double* record, int length);
  void enter_store(std::int64_t tag);
  /// Both at once, for a granule with all contacts that it has with granules which are stored already.
  void add_stored(const StoredGranule& g, const double* record, int length, const ContactList& contacts);
  void stands_otherwise() { ++standing_version_; }
  void tell_settled() {
    tell([](BodyFollower& f) { f.settled(); });
  }

  // --- walls
  /// A stored granule came from another rank with these.
  void add_wall_loads(std::int64_t tag, int body, const std::vector<WallLoad>& loads) { wall_loads_.add(tag, body, loads); }
  double weigh_wall_loads(int body, const Vec3& load) { return wall_loads_.weigh(body, load); }
  void share_out_wall_loads(int body, double sum) { wall_loads_.share_out(body, sum); }

  // --- the ledger
  void count_locked() { ledger_.locked(); }
  void count_locked_again(bool moved) { ledger_.locked_again(moved); }
  void count_restored(double energy) { ledger_.restored(energy); }
  void count_woken(Woke by) { ledger_.woken(by); }
  void count_refilled(double energy) { ledger_.refilled(energy); }
  void count_carves(std::size_t n) {
    for (; n > 0; --n) ledger_.carved();
  }
  void set_counters(const Ledger::Counters& c) { ledger_.set_counters(c); }

  /// Gives memory back that was needed once; returns how many bytes.
  std::size_t fit();
  std::size_t memory_bytes() const;

 private:
  Vec3 free_site(int body, const Vec3& place, double radius) const;
  void find_grid(int body);
  bool is_large(std::size_t granules) const { return granules >= pack_from_; }
  InnerContacts::Tail take_from_graph(const StoredGranule& g, bool all_given);
  void grounded_or_let_go(int body);
  void leaves_store(std::int64_t tag);
  void entered_store(std::int64_t tag);
  void drop_what_is_known(std::int64_t tag);
  void changed(int body, const Sphere& granule) {
    tell([&](BodyFollower& f) { f.granule_changed(body, granule); });
  }
  template <class Tell>
  void tell(Tell tell) {
    for (BodyFollower* f : followers_) tell(*f);
  }

  const Scales& scales_;
  std::vector<BodyFollower*> followers_;
  std::unique_ptr<Sites> sites_;  // `store none`
  std::unique_ptr<GranuleStore> store_;
  FrozenContacts contacts_;
  SolidBodies bodies_;
  std::unique_ptr<InnerContacts> inner_;
  std::size_t pack_from_ = 15000;  // granules: three megabytes of contacts
  bool packs_ = true;              // what is put away now
  FrozenWallLoads wall_loads_;     // of stored granules
  Ledger ledger_;
  std::vector<double> largest_radius_by_type_;
  int standing_version_ = 0;
};

}  // namespace solidcull
