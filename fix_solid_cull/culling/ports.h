// All that the culling asks of an engine: eight small ports (proxies). An engine implements them once; the tests have a small
// world in memory that does (tests/unit/small_world.h). SI units; world frame.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "box.h"
#include "clump_mass.h"
#include "frozen_wall_loads.h"
#include "internal_error.h"
#include "sphere.h"

namespace solidcull {

class Ranks;

inline Vec3 vec(const double* v) { return Vec3(v[0], v[1], v[2]); }
inline void set(double* to, const Vec3& v) {
  for (int d = 0; d < 3; ++d) to[d] = v[d];
}

/// A vector in a row that ranks exchange: such rows are copied byte by byte.
using Triple = std::array<double, 3>;
inline Triple triple(const Vec3& v) { return {v[0], v[1], v[2]}; }
inline Vec3 vec(const Triple& t) { return vec(t.data()); }

/// The granules that are atoms in the engine, as views of its arrays: the owned ones first, then ghosts. Views hold for one hook;
/// take_out() and put_back() renew them. Local, but for what says otherwise.
class Atoms {
 public:
  virtual ~Atoms() = default;

  int owned = 0, ghosts = 0;
  int room = 0;  ///< owned atoms and ghosts that the arrays have room for
  double *x = nullptr, *v = nullptr, *omega = nullptr, *f = nullptr, *torque = nullptr;  ///< rows of three
  const double *radius = nullptr, *mass = nullptr;
  const int *tag = nullptr, *type = nullptr;
  int* groups = nullptr;  ///< bits of the groups that an atom is in
  int interface_bit = 0;  ///< the group of interface granules
  int own_bit = 0;        ///< the fix's own group
  int movable_bits = 0;   ///< groups whose spheres an integrator moves, each by itself
  int held_bits = 0;      ///< groups that something holds or drives: never culled
  int gravity_bits = 0;   ///< groups that gravity pulls, each by a fix of its own; 0: there is no gravity

  Vec3 place(int i) const { return vec(x + 3 * std::size_t(i)); }
  Vec3 velocity(int i) const { return vec(v + 3 * std::size_t(i)); }
  Vec3 spin(int i) const { return vec(omega + 3 * std::size_t(i)); }
  Vec3 force(int i) const { return vec(f + 3 * std::size_t(i)); }
  void set_place(int i, const Vec3& to) { set(x + 3 * std::size_t(i), to); }
  void set_velocity(int i, const Vec3& to) { set(v + 3 * std::size_t(i), to); }
  void set_spin(int i, const Vec3& to) { set(omega + 3 * std::size_t(i), to); }
  void clear_force(int i) { set(f + 3 * std::size_t(i), Vec3::Zero()); }
  void clear_torque(int i) { set(torque + 3 * std::size_t(i), Vec3::Zero()); }
  void clear_load(int i) {
    clear_force(i);
    clear_torque(i);
  }
  Sphere sphere(int i) const { return {place(i), radius[i]}; }
  bool is_interface(int i) const { return (groups[i] & interface_bit) != 0; }
  void mark_interface(int i, bool on) { on ? groups[i] |= interface_bit : groups[i] &= ~interface_bit; }
  /// Fixes may move granules along ways of their own for some time.
  struct Ways {
    const double* until =
        nullptr;  ///< the last step at which a granule is moved so, every `stride` numbers; nullptr: no fix does
    int stride = 0;
    double step = 0;  ///< this one
    bool hold(int i) const { return until && until[std::size_t(stride) * std::size_t(i)] >= step; }
  };
  Ways ways;

  /// An integrator moves it, all the gravity there is pulls it, and nothing else holds or drives it. Clumps are moved whatever
  /// their groups; what moves them moves nothing else.
  bool may_be_culled(int i, bool of_clump) const { return groups_may_be_culled(groups[i], of_clump) && !ways.hold(i); }
  bool groups_may_be_culled(int g, bool of_clump) const {
    return (g & own_bit) && (of_clump || (g & movable_bits)) && !(g & held_bits) && (g & gravity_bits) == gravity_bits;
  }

  /// Everything that the engine keeps of owned granule i, as doubles; `layout`: the number of its columns' layout.
  virtual void pack(int i, std::vector<double>& record, int& layout) = 0;
  /// Which numbers of a record are position (where `positions`), velocity and spin (where `spins`); found by trying them on owned
  /// granule i.
  virtual std::vector<int> motion_words(int i, bool positions, bool spins) = 0;
  /// The groups (bits) of the granule of a record. Only where atoms may be made.
  virtual int groups_of(const std::vector<double>& record, int layout) = 0;
  /// Deletes owned granule i; the last owned granule takes its index. Only while membership changes.
  virtual void take_out(int i) = 0;
  /// A granule from its record; returns its index. Only while membership changes.
  virtual int put_back(const std::vector<double>& record, int layout) = 0;
  /// Into the periodic box; which image it is follows from the place.
  virtual void wrap(int i) = 0;
  /// Owned granule i has this size (m, kg) from here on.
  virtual void set_size(int i, double radius, double mass) = 0;
  virtual void drop_ghosts() = 0;
  /// Granules may be anywhere in the box: each goes to the rank that has its place. Collective.
  virtual void send_far() = 0;

  /// Column layouts for restart files and other ranks.
  virtual int layouts() const = 0;
  virtual std::string layout_text(int layout) const = 0;
  virtual int layout_from_text(const std::string& text) = 0;

  /// The engine learns how many atoms there are over all ranks; `returned`: that came out of the store (negative: went in), over
  /// all ranks, so that it misses none; whether the map by tags is too small for what some rank has. All ranks say so alike.
  virtual void publish_counts(std::int64_t returned, std::int64_t atoms, bool map_too_small) = 0;
  virtual bool map_is_too_small() const = 0;  ///< for what this rank has
  /// So many more atoms, over all ranks, have come out of the store as publish_counts() has told: until then. Local.
  virtual void count_more(std::int64_t returned) = 0;
  virtual void sort_soon() = 0;  ///< many atoms are new: the engine should sort them
};

/// A clump as the engine moves it: a rigid granule of several spheres. World frame.
struct Clump {
  int number = 0, spheres = 0;
  double mass = 0;  ///< kg
  ClumpMass lies{Vec3::Zero(), Eigen::Quaterniond::Identity(), Vec3::Zero()};
  Vec3 velocity = Vec3::Zero();          ///< of its centre of mass (m/s)
  Vec3 angular_momentum = Vec3::Zero();  ///< about that (kg m^2/s)
  std::vector<double> rest;              ///< what the engine keeps of it besides

  Vec3 spin() const { return lies.turn * (lies.turn.conjugate() * angular_momentum).cwiseQuotient(lies.inertia); }
  void move_as(const Vec3& its_velocity, const Vec3& its_spin) {
    velocity = its_velocity;
    angular_momentum = lies.tensor() * its_spin;
  }
  double kinetic_energy() const { return 0.5 * mass * velocity.squaredNorm() + 0.5 * spin().dot(angular_momentum); }
};

/// Granules of several spheres. Each sphere is an atom, with the mass of the whole clump; one rank, near its spheres, moves the
/// clump. Local.
class Clumps {
 public:
  virtual ~Clumps() = default;

  bool possible = false;  ///< there may be some in this deck; all ranks say the same
  /// Where the engine says which array has the number of the clump that an atom, owned or ghost, is a sphere of; below 1: of
  /// none.
  int* const* of_atom = nullptr;
  int rest_size = 0;  ///< of Clump::rest

  int of(int i) const { return possible ? std::max((*of_atom)[i], 0) : 0; }
  /// The clumps that this rank moves: how many, and one of them; the one with this number, if it is here.
  virtual int count() const = 0;
  virtual Clump clump(int k) const = 0;
  virtual Vec3 centre(int k) const = 0;    ///< by which the engine tells its owner (m)
  virtual int find(int number) const = 0;  ///< which of them it is; -1: none
  /// Farthest that spheres of a clump may be apart, centre to centre (m), of any that this rank has ever moved or was told of.
  virtual double largest() const = 0;
  virtual void know_largest(double apart) = 0;
  /// No clump that is made from here on gets a number up to the highest that there was, or that was told.
  virtual int highest_number() const = 0;
  /// So many are moved, over all ranks. All ranks say so alike.
  virtual void publish_count(std::int64_t all) = 0;
  virtual void keep_number(int number) = 0;
  // --- only while membership changes
  /// The engine moves it no more, and knows it no more. Which of them comes under another number may change.
  virtual Clump take(int number) = 0;
  /// It moves it again, with these spheres on any rank; atom `sphere`, which is here, says which periodic image it is in.
  virtual void put(const Clump& clump, int sphere) = 0;
  /// Atom i is a sphere of this clump from here on; 0: a granule of its own. Its ghosts do not hear of it.
  virtual void set_clump(int i, int number) = 0;
  /// The engine's exchange, which goes one rank far, would lose some that are here, or on another rank: they go to the ranks that
  /// own their centres. Collective.
  virtual void send_far(const Ranks& ranks) = 0;
  /// Owned atom i is in the periodic image in which it is nearest to owned atom `to`, a sphere of the same clump.
  virtual void join_image(int i, int to) = 0;
};

/// Neighbour pairs as rows: partner k of owned atom `row[r]` is partners[row[r]][k] & mask. Each pair of owned atoms stands once,
/// a pair with a ghost on each side.
struct NeighbourRows {
  int rows = 0;
  const int *row = nullptr, *count = nullptr;
  const int* const* partners = nullptr;
  int mask = ~0;

  /// Calls visit(i, j, k) for each pair: owned atom i, its partner j, j's number in i's row.
  template <class Visit>
  void for_each_pair(int owned, Visit visit) const {
    for (int r = 0; r < rows; ++r) {
      const int i = row[r];
      if (i >= owned) continue;
      for (int k = 0; k < count[i]; ++k) visit(i, partners[i][k] & mask, k);
    }
  }
};

/// Contact histories of owned granules, each pair on both sides: tags of the partners and `width` numbers for each.
struct HistoryRows {
  const int* count = nullptr;
  const int* const* partner = nullptr;
  const double* const* history = nullptr;
  int width = 0;

  /// Calls visit(tag of the partner, history as granule i sees it); nothing where the contact model keeps no history.
  template <class Visit>
  void for_each_partner(int i, Visit visit) const {
    if (!count) return;
    for (int k = 0; k < count[i]; ++k)
      visit(static_cast<std::int64_t>(partner[i][k]), history[i] + static_cast<std::ptrdiff_t>(width) * k);
  }
};

/// What touches what, and how hard. Local.
class Contacts {
 public:
  virtual ~Contacts() = default;

  /// Two granules closer than this times the sum of their radii bear on each other (above 1 with cohesion).
  double reach_factor = 1;
  /// Contacts between granules turn them, by friction or rolling friction. Where none does, a granule's spin is its own: no body
  /// turns it, and it turns no body.
  bool turn_granules = true;

  virtual NeighbourRows neighbours() const = 0;   ///< valid until the next neighbour build
  virtual HistoryRows histories() const = 0;      ///< valid between pre_exchange and the next neighbour build
  virtual std::vector<bool> flips() const = 0;    ///< for each history number: does it change sign with the side
  virtual std::vector<int> vectors() const = 0;   ///< first indices of those that are vectors of space
  virtual void bring_histories_up_to_date() = 0;  ///< outside of a time step
  virtual void forget_neighbours() = 0;           ///< the lists are empty until they are built again

  struct History {
    std::int64_t partner;
    const double* numbers;
  };
  /// Adds n contacts to an owned granule's list; a partner that is there already keeps what it has.
  virtual void give_histories(int i, const History* contacts, std::size_t n) = 0;
  virtual void clear_histories(int i) = 0;

  /// Force (N) on atom i by partner k of its row.
  virtual Vec3 force_on_first(int i, int k) = 0;
  /// Force (N) on owned atom i by owned atom j with this history (nullptr: none).
  virtual Vec3 force_on_first(int i, int j, const double* history) = 0;
  /// Pairs of atoms with the same body number (0: none) are taken out of the neighbour lists.
  virtual void leave_out_pairs_within(const std::vector<std::int64_t>& body_of_atom) = 0;
};

/// An owned granule within the skin of a wall, or, where a mesh stands still, within half of it.
struct WallContact {
  int granule;   ///< index of the owned atom
  Vec3 to_wall;  ///< from the granule's centre to the nearest point of the wall (m)
  double gap;    ///< surface to wall; negative: overlap (m)
  bool moving;   ///< the wall can move
};

struct WallTriangle {
  int mesh, index;  ///< the engine's numbers; valid until triangles() is called again
  Vec3 corner[3];
  Box box;      ///< around its corners
  bool moving;  ///< the mesh can move
};

/// Walls and meshes. Local.
class Walls {
 public:
  virtual ~Walls() = default;
  /// All owned granules near a wall, see WallContact. Valid while neighbour lists are.
  virtual std::vector<WallContact> contacts() const = 0;
  virtual std::vector<WallTriangle> triangles() const = 0;
  /// Is a sphere that is no atom closer than `gap` to the triangle, or to any wall that is no mesh?
  virtual bool near(const WallTriangle& t, const Sphere& s, double gap) const = 0;
  virtual bool primitive_near(const Sphere& s, double gap) const = 0;
  virtual std::vector<std::string> names() const = 0;  ///< sorted: to see that one has gone
  /// Numbers that are others if a wall that stands still was made, taken away, moved or changed since; between runs. Local.
  virtual std::vector<double> fingerprint() const = 0;
  /// This rank's part of a sum over ranks that says the same of walls that stand still on any number of ranks, and in another
  /// process: another one if a wall is elsewhere, moves, or is of other material, or if there are others.
  virtual std::uint64_t part_of_sum() const = 0;
  /// Of the meshes that report their load, by WallLoad::mesh.
  virtual const std::vector<std::string>& mesh_names() const = 0;
  /// What still elements of meshes that report their load did to the granule in this step.
  virtual std::vector<WallLoad> loads_on(std::int64_t tag) = 0;
  /// A mesh element bears this in addition (N, N m about the mesh's point of reference), in this step.
  virtual void press(int mesh, int element, const Vec3& force, const Vec3& torque) = 0;
};

/// Places where fixes insert granules, looking at atoms only. Local.
class Insertions {
 public:
  virtual ~Insertions() = default;
  virtual bool any_due(std::int64_t step) const = 0;  ///< at that step of the deck
  /// Of what is to be inserted at this step or the next: boxes that hold the centre of each granule, `largest` (m) in radius at
  /// most, that could touch what comes, or that the fix counts.
  virtual std::vector<Box> due_boxes(double largest) const = 0;
  /// Boxes around meshes that count the atoms that pass, `margin` larger on each side: what is in them must be atoms.
  virtual std::vector<Box> counting(double margin) const = 0;
};

/// A file that all ranks write to, each at places of its own. What goes wrong is told at the end.
class SharedFile {
 public:
  virtual ~SharedFile() = default;
  virtual std::uint64_t size() const = 0;                                     ///< as it was found, alike on all ranks
  virtual void write(std::uint64_t at, const void* from, std::size_t n) = 0;  ///< Local
  /// What was written is on the disk: 0, or the errno of what went wrong on this rank. Collective.
  virtual int close() = 0;
};

/// Ranks, and periodic images, which are neighbours too. Rows are plain structs; the same type is named by all ranks.
class Ranks {
 public:
  virtual ~Ranks() = default;

  int me = 0, count = 1;

  /// Whether it holds on any rank. Collective.
  virtual bool any(bool here) const = 0;
  /// Sums, or largest values, over all ranks, in place. Collective.
  virtual void sum(double* numbers, int n) const = 0;
  virtual void sum(std::int64_t* numbers, int n) const = 0;
  virtual void largest(double* numbers, int n) const = 0;
  virtual void largest(std::int64_t* numbers, int n) const = 0;
  /// Bits that are set on any rank: asked for now, known when the step has gone on. One question at a time. Collective.
  virtual void begin_any(unsigned bits) const = 0;
  virtual unsigned end_any() const = 0;

  /// Between two ranks that both know of it: messages come in the order in which they were sent. The sender does not wait.
  virtual void send(int rank, const void* bytes, std::size_t n) const = 0;
  virtual std::vector<char> receive(int rank) const = 0;
  template <class Row>
  void send_rows(int rank, const std::vector<Row>& rows) const {
    send(rank, rows.data(), rows.size() * sizeof(Row));
  }
  template <class Row>
  std::vector<Row> receive_rows(int rank) const {
    const std::vector<char> bytes = receive(rank);
    std::vector<Row> rows(bytes.size() / sizeof(Row));
    if (!rows.empty()) std::memcpy(rows.data(), bytes.data(), bytes.size());
    return rows;
  }
  /// The sum over the ranks before this one. Collective.
  virtual std::int64_t sum_before(std::int64_t number) const = 0;

  /// False where one rank owns a box without periodic sides: exchange() gives nothing then.
  virtual bool has_neighbours() const = 0;
  /// A box that follows the granules does so now, as the engine will before it sends them to other ranks. Collective.
  virtual void follow_box() {}
  /// Subdomains may have moved: reads them anew, on all ranks. Local.
  virtual void update() = 0;
  /// Since then, of any rank: all say the same. Local.
  virtual bool subdomains_changed() const = 0;
  /// Whether this rank's subdomain holds the place (periodic images wrapped).
  virtual bool owns(const Vec3& place) const { return owner(place) == me; }
  virtual int owner(const Vec3& place) const = 0;
  /// This rank's subdomain (m).
  virtual Box own() const = 0;
  /// Where the box is cut along each axis, its ends included (m); how near two cuts may be. Local, alike on all ranks.
  virtual std::array<std::vector<double>, 3> cuts() const = 0;
  virtual double thinnest() const = 0;
  /// The cuts are these from here on; the engine sends its atoms where they belong now, which is no farther than a neighbour. All
  /// ranks say so alike, while membership changes.
  virtual void move_cuts(const std::array<std::vector<double>, 3>& to) = 0;
  /// Ranks along a way from any rank to the one that is farthest from it, over their borders.
  virtual int hops() const = 0;
  /// Whether a place is farther outside of this rank's subdomain than granules get between two neighbour builds.
  virtual bool is_far_out(const Vec3& place) const = 0;
  /// Whether the engine's exchange brings an atom at this place to its owner: this rank, or one beside it, over corners too.
  /// Local.
  virtual bool brings_home(const Vec3& place) const = 0;
  /// Rows that ranks exchange may be so from here on, and all ranks are neighbours; all ranks say so alike. Local.
  virtual void expect_far_out(bool on) = 0;
  /// Ranks that may own what has left this rank's subdomain, or (m) is as near to it, ascending; each of them has this one among
  /// its own. Local.
  virtual std::vector<int> neighbours(double width) const = 0;
  /// Shifts by which periodic images of a place near this rank may differ, the zero shift first (m).
  virtual const std::vector<Vec3>& image_shifts() const = 0;

  /// Rows whose first member is the place `Triple at`. Each goes to every other rank and periodic image whose subdomain is within
  /// `width` (m) of it; what comes back has its place shifted into this rank's neighbourhood. Collective.
  template <class Row>
  std::vector<Row> exchange(const std::vector<Row>& rows, double width) const {
    static_assert(std::is_trivially_copyable<Row>::value && std::is_same<decltype(Row::at), Triple>::value,
                  "a row is plain data");
    static_assert(offsetof(Row, at) == 0, "the place comes first");
    std::vector<Row> in;
    exchange_bytes(rows.data(), rows.size(), sizeof(Row), width, [&](std::size_t n) {
      in.resize(n);
      return in.data();
    });
    return in;
  }
  /// All rows of all ranks, in rank order: on every rank, or on rank 0 only. Collective.
  template <class Row>
  std::vector<Row> gather(const std::vector<Row>& rows) const {
    return gathered(rows, true);
  }
  template <class Row>
  std::vector<Row> gather_on_root(const std::vector<Row>& rows) const {
    return gathered(rows, false);
  }
  /// Rows for some ranks, by rank; returns what came, by the rank that sent it. No rank learns more. Collective.
  template <class Row>
  std::map<int, std::vector<Row>> deliver(const std::map<int, std::vector<Row>>& to) const {
    static_assert(std::is_trivially_copyable<Row>::value, "a row is plain data");
    std::vector<Letter> letters;
    for (const auto& [rank, rows] : to)
      if (!rows.empty()) letters.push_back({rank, rows.data(), rows.size()});
    std::map<int, std::vector<Row>> came;
    deliver_bytes(letters, sizeof(Row), [&](int from, std::size_t n) {
      std::vector<Row>& rows = came[from];
      rows.resize(n);
      return static_cast<void*>(rows.data());
    });
    return came;
  }

  /// A file that is there. Collective.
  virtual std::unique_ptr<SharedFile> open_to_write(const std::string& file) const = 0;

 protected:
  /// Makes room for n rows and says where they go.
  using Room = std::function<void*(std::size_t n)>;
  virtual void exchange_bytes(const void* rows, std::size_t n, std::size_t bytes, double width, const Room& room) const = 0;
  virtual void gather_bytes(const void* rows, std::size_t n, std::size_t bytes, bool everywhere, const Room& room) const = 0;
  struct Letter {
    int to;
    const void* rows;
    std::size_t n;
  };
  using RoomFrom = std::function<void*(int from, std::size_t n)>;
  virtual void deliver_bytes(const std::vector<Letter>& letters, std::size_t bytes, const RoomFrom& room) const = 0;

 private:
  template <class Row>
  std::vector<Row> gathered(const std::vector<Row>& rows, bool everywhere) const {
    static_assert(std::is_trivially_copyable<Row>::value, "a row is plain data");
    std::vector<Row> all;
    gather_bytes(rows.data(), rows.size(), sizeof(Row), everywhere, [&](std::size_t n) {
      all.resize(n);
      return all.data();
    });
    return all;
  }
};

/// The run: time, box, gravity. The numbers hold for one hook.
class Run {
 public:
  virtual ~Run() = default;

  std::int64_t step = 0;        ///< goes on where the deck resets its time step
  std::int64_t reset_by = 0;    ///< the deck's number of this step, less `step`
  std::int64_t steps_left = 0;  ///< of this run, as far as the deck says
  double dt = 0;                ///< s
  double skin = 0;              ///< Verlet skin (m)
  Box box;                      ///< the whole of it
  Box kept;                     ///< what passes its sides is lost; infinite where the box is periodic or follows the granules
  std::array<bool, 3> periodic{};
  std::string name;  ///< the fix's ID

  std::int64_t deck_step() const { return step + reset_by; }
  Vec3 edges() const { return box.hi - box.lo; }
  bool keeps(const Vec3& x) const { return (x.array() >= kept.lo.array()).all() && (x.array() < kept.hi.array()).all(); }
  bool any_periodic() const { return periodic[0] || periodic[1] || periodic[2]; }

  virtual Vec3 gravity() const = 0;                   ///< m/s^2, now
  virtual Vec3 wrapped(const Vec3& place) const = 0;  ///< into the periodic box
  /// Neighbour lists are to be built at this step, so that membership can change. True if that was not asked for already. All
  /// ranks ask alike.
  virtual bool ask_for_reneighbouring(std::int64_t step) = 0;
  virtual double seconds_of_pair_forces() const = 0;    ///< in this run, on this rank. Local
  virtual void say(const std::string& line) const = 0;  ///< one line to screen and log, by rank 0, under the fix's name
};

/// The engine's memory, cut to what is left once most granules are stored. Local.
class Memory {
 public:
  virtual ~Memory() = default;
  virtual void freed(std::size_t bytes) = 0;  ///< so many bytes more: may give them back to the system
  /// A change begins that takes so many granules in: what the engine makes anew after it is given up first, where that is much.
  virtual void make_room(std::size_t granules) = 0;
  /// Many granules go in, and more will until so many owned atoms are left: arrays are cut to those that are there, but stay
  /// too_large() for the end if they were.
  virtual void give_rows_back(int left) = 0;
  virtual bool too_large() const = 0;           ///< arrays are far larger than the atoms need
  virtual void fit() = 0;                       ///< cuts them. While membership changes, not at the start of a run
  virtual void fit_bins(bool some_stored) = 0;  ///< likewise: wider search bins where few atoms are left
  virtual void give_bins_back() = 0;
  /// A run begins with stored granules, the largest of this radius (m): likewise, before the engine makes its bins.
  virtual void expect_stored(double largest_radius) = 0;
};

struct Ports {
  Atoms& atoms;
  Clumps& clumps;
  Contacts& contacts;
  Walls& walls;
  Insertions& insertions;
  Ranks& ranks;
  Run& run;
  Memory& memory;
};

}  // namespace solidcull
