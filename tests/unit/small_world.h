// A small world in memory that implements the ports of culling/ports.h: spheres, clumps of them (small_clumps.h), springs, walls,
// a velocity-Verlet integrator. On one rank, or on several in one process, one thread each. SI units; world frame. No engine, no
// MPI.
#pragma once

#include <array>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "culling.h"
#include "per_granule.h"
#include "ports.h"
#include "small_clumps.h"

namespace solidcull {

constexpr double r = 0.005;                                       // m, of most granules in the tests
constexpr double apart = 0.999 * 2 * r, pressed = 0.998 * 2 * r;  // m, two that touch

class SmallWorld;

/// Where ranks meet. A rank that waits for one that does not come, or that has called something else, gets an exception: a
/// deadlock is a failed test, no test that hangs.
class Meeting {
 public:
  explicit Meeting(int ranks, double seconds = 20) : slots_(static_cast<std::size_t>(ranks)), seconds_(seconds) {}

  /// The bytes of all ranks, once all have come with the same `what`. Collective.
  std::vector<std::vector<char>> gather(int rank, const std::string& what, const void* bytes, std::size_t n);
  /// A message from one rank to another; those between two come in their order. take() waits for one.
  void post(int from, int to, const void* bytes, std::size_t n);
  std::vector<char> take(int from, int to);
  /// The rank comes no more.
  void leave(int rank);

  /// Another rank ended or failed, or did not come.
  struct Broken : std::runtime_error {
    using std::runtime_error::runtime_error;
  };

 private:
  struct Slot {
    std::string what;
    std::vector<char> bytes;
  };
  void wait(int rank, std::unique_lock<std::mutex>& lock);

  std::mutex mutex_;
  std::condition_variable all_came_;
  std::vector<Slot> slots_;
  const double seconds_;
  std::size_t came_ = 0;
  std::uint64_t round_ = 0;
  std::string broken_, gone_;
  std::set<int> left_;
  std::map<std::pair<int, int>, std::deque<std::vector<char>>> posted_;  // by from and to
};

/// What a deck sets, alike on all ranks.
struct SmallDeck {
  Box box{Vec3::Constant(-1), Vec3::Constant(1)};
  std::array<bool, 3> periodic{};
  std::array<int, 3> split{1, 1, 1};  ///< ranks along x, y, z
  double skin = 1e-3, dt = 1e-4;
  Vec3 gravity = Vec3(0, 0, -9.81);
  double density = 2500;
  double stiffness = 1000, damping = 0.5, friction = 0.5;  ///< N/m, N s/m, -
  double shear_stiffness = 500;                            ///< of the spring in the contact history (N/m)
  bool arms_meet = false;  ///< arms of contacts end where they meet, and overlap nowhere: angular momentum is kept exactly
  bool clumps = false;     ///< there may be some

  struct Plane {
    std::string name;
    Vec3 point, normal;  ///< granules are where the normal points
    bool moving = false;
    Vec3 velocity = Vec3::Zero();
  };
  struct Mesh {
    std::string name;
    std::vector<std::array<Vec3, 3>> triangles;
    bool moving = false;
    bool reports_load = true;
    Vec3 reference = Vec3::Zero();  ///< torques are about it
  };
  struct Source {
    Box box;
    std::int64_t next = -1;  ///< step at which it inserts
    double radius = 0;       ///< the largest of what it inserts
  };
  std::vector<Plane> planes;
  std::vector<Mesh> meshes;
  std::vector<Source> sources;

  /// Two triangles at this height, with edges of `size`.
  static Mesh floor(double z, double size, const std::string& name = "floor");
  static Plane ground(double z, const std::string& name = "ground") { return {name, Vec3(0, 0, z), Vec3(0, 0, 1)}; }
};

/// No walls, no gravity.
inline SmallDeck empty_space() {
  SmallDeck deck;
  deck.gravity = Vec3::Zero();
  return deck;
}

class SmallAtoms : public Atoms {
 public:
  static constexpr int all_bit = 1, interface_group = 2, held_group = 4;
  using Histories = std::map<int, std::array<double, 3>>;  // by the partner's tag

  explicit SmallAtoms(SmallWorld& world);
  void pack(int i, std::vector<double>& record, int& layout) override;
  std::vector<int> motion_words(int i, bool positions, bool spins) override;
  int groups_of(const std::vector<double>& record, int layout) override;
  void take_out(int i) override;
  int put_back(const std::vector<double>& record, int layout) override;
  void wrap(int i) override;
  void set_size(int i, double radius, double mass) override;
  void send_far() override { ++sent_far; }
  int layouts() const override { return static_cast<int>(texts_.size()); }
  std::string layout_text(int layout) const override { return texts_.at(static_cast<std::size_t>(layout)); }
  int layout_from_text(const std::string& text) override;
  void publish_counts(std::int64_t returned, std::int64_t atoms, bool map_too_small) override;
  bool map_is_too_small() const override { return false; }
  void count_more(std::int64_t returned) override;
  void sort_soon() override { sort_asked = true; }

  int find(int wanted) const;  ///< owned; -1: none
  int append();                ///< a new owned atom, all zero
  void drop_ghosts() override { ghosts = 0; }
  int append_ghost();
  void swap(int i, int j);  ///< owned ones; followers follow
  void fit(int new_room);
  Histories& histories(int i) { return histories_[static_cast<std::size_t>(i)]; }
  Vec3 arm(int i) const { return vec(&arm_[3 * static_cast<std::size_t>(i)]); }  ///< in its clump's axes (m)
  void set_clump(int i, int number, const Vec3& arm);

  int* clump = nullptr;  ///< number of the clump that it is a sphere of; 0: none

  std::vector<double> colour;  ///< a column that the culling knows nothing of
  std::int64_t published = -1, returned_last = 0;
  bool sort_asked = false;
  int sent_far = 0;
  std::vector<FollowsAtoms*> followers;

 private:
  void grow(int new_room);
  void renew();
  void copy(int from, int to);

  SmallWorld& world_;
  std::vector<double> x_, v_, omega_, f_, torque_, arm_, radius_, mass_;
  std::vector<int> tag_, type_, groups_, clump_;
  std::vector<Histories> histories_;
  std::vector<std::string> texts_;
};

/// A linear spring and dashpot along the normal; along the surface a spring whose length is the contact's history, held by
/// Coulomb's friction.
class SmallContacts : public Contacts {
 public:
  explicit SmallContacts(SmallWorld& world) : world_(world) {}
  NeighbourRows neighbours() const override;
  HistoryRows histories() const override;
  std::vector<bool> flips() const override { return std::vector<bool>(static_cast<std::size_t>(width), true); }
  std::vector<int> vectors() const override { return width ? std::vector<int>{0} : std::vector<int>{}; }
  void bring_histories_up_to_date() override { ++brought_up_to_date; }
  void forget_neighbours() override { rows_are_invalid(); }
  void give_histories(int i, const History* contacts, std::size_t n) override;
  void clear_histories(int i) override;
  Vec3 force_on_first(int i, int k) override;
  Vec3 force_on_first(int i, int j, const double* history) override;
  void leave_out_pairs_within(const std::vector<std::int64_t>& body_of_atom) override;

  void build();                           ///< rows by brute force
  void add_forces();                      ///< and histories go on by a time step
  bool listed(int tag, int other) const;  ///< either way
  void rows_are_invalid() { valid_ = false; }

  int width = 3;
  int brought_up_to_date = 0;

 private:
  static constexpr int mask_ = 0x3fffffff, mark_ = 0x40000000;  // bits above the mask belong to the engine
  Vec3 force(int i, int j, const Vec3& spring, Vec3* sheared, double dt) const;

  SmallWorld& world_;
  bool valid_ = false;
  std::vector<std::vector<int>> partners_;
  std::vector<int> row_, count_;
  std::vector<const int*> first_;
  mutable std::vector<int> history_count_;
  mutable std::vector<std::vector<int>> history_partner_;
  mutable std::vector<std::vector<double>> history_numbers_;
  mutable std::vector<const int*> partner_rows_;
  mutable std::vector<const double*> number_rows_;
};

class SmallWalls : public Walls {
 public:
  explicit SmallWalls(SmallWorld& world) : world_(world) {}
  std::vector<WallContact> contacts() const override;
  std::vector<WallTriangle> triangles() const override;
  bool near(const WallTriangle& t, const Sphere& s, double gap) const override;
  bool primitive_near(const Sphere& s, double gap) const override;
  std::vector<std::string> names() const override;
  std::vector<double> fingerprint() const override;
  std::uint64_t part_of_sum() const override;
  const std::vector<std::string>& mesh_names() const override;
  std::vector<WallLoad> loads_on(std::int64_t tag) override;
  void press(int mesh, int element, const Vec3& force, const Vec3& torque) override;

  void begin_step();
  void add_forces();
  void move();  ///< moving planes, over a time step
  struct Borne {
    Vec3 force = Vec3::Zero(), torque = Vec3::Zero();  ///< of the step
    Vec3 pressed = Vec3::Zero();                       ///< the part of the force that came by press()
  };
  std::map<std::pair<int, int>, Borne> borne;  ///< by mesh and element
  Vec3 borne_by_meshes() const;

 private:
  struct Touch {
    int granule;
    Vec3 to_wall;
    double gap;
    int plane, mesh, element;  // -1: not one
    bool moving;
  };
  std::vector<Touch> find(double gap) const;

  SmallWorld& world_;
  std::vector<std::pair<std::int64_t, WallLoad>> seen_;
  mutable std::vector<std::string> mesh_names_;
};

class SmallInsertions : public Insertions {
 public:
  explicit SmallInsertions(SmallWorld& world) : world_(world) {}
  bool any_due(std::int64_t step) const override;
  std::vector<Box> due_boxes(double largest) const override;
  std::vector<Box> counting(double) const override { return {}; }

 private:
  SmallWorld& world_;
};

class SmallRanks : public Ranks {
 public:
  SmallRanks(SmallWorld& world, Meeting* meeting, int rank, int ranks);
  bool any(bool here) const override;
  void sum(double* numbers, int n) const override;
  void sum(std::int64_t* numbers, int n) const override;
  void largest(double* numbers, int n) const override;
  void largest(std::int64_t* numbers, int n) const override;
  std::int64_t sum_before(std::int64_t number) const override;
  void begin_any(unsigned bits) const override { asked_ = bits; }
  unsigned end_any() const override;
  void send(int rank, const void* bytes, std::size_t n) const override;
  std::vector<char> receive(int rank) const override;
  bool has_neighbours() const override;
  void update() override;
  bool subdomains_changed() const override;
  int owner(const Vec3& place) const override;
  Box own() const override { return subdomain(me); }
  std::array<std::vector<double>, 3> cuts() const override { return cuts_; }
  double thinnest() const override;
  void move_cuts(const std::array<std::vector<double>, 3>& to) override { cuts_ = to; }
  Box subdomain(int rank) const;
  int hops() const override;
  bool is_far_out(const Vec3&) const override { return false; }  // rows go to all ranks here
  bool brings_home(const Vec3&) const override { return true; }  // and atoms
  void expect_far_out(bool) override {}
  std::vector<int> neighbours(double width) const override;
  const std::vector<Vec3>& image_shifts() const override { return shifts_; }
  std::unique_ptr<SharedFile> open_to_write(const std::string& file) const override;

  /// Rows of all ranks, by rank. Collective.
  std::vector<std::vector<char>> all(const std::string& what, const void* bytes, std::size_t n) const;
  mutable int collectives = 0;        ///< so many so far
  mutable int messages = 0;           ///< so many sent
  mutable std::size_t delivered = 0;  ///< bytes of rows that others have sent to this rank

 protected:
  void exchange_bytes(const void* rows, std::size_t n, std::size_t bytes, double width, const Room& room) const override;
  void gather_bytes(const void* rows, std::size_t n, std::size_t bytes, bool everywhere, const Room& room) const override;
  void deliver_bytes(const std::vector<Letter>& letters, std::size_t bytes, const RoomFrom& room) const override;

 private:
  template <class Number, class Unite>
  void unite(const char* what, Number* numbers, int n, Unite unite) const;

  SmallWorld& world_;
  Meeting* meeting_;
  std::vector<Vec3> shifts_{Vec3::Zero()};
  std::array<std::vector<double>, 3> cuts_;
  std::vector<Box> known_;  // subdomains of all ranks
  mutable unsigned asked_ = 0;
};

class SmallRun : public Run {
 public:
  explicit SmallRun(SmallWorld& world) : world_(world) {}
  Vec3 gravity() const override;
  Vec3 wrapped(const Vec3& place) const override;
  bool ask_for_reneighbouring(std::int64_t at) override;
  double seconds_of_pair_forces() const override { return pair_forces; }
  void say(const std::string& line) const override;

  std::int64_t asked = -1;
  double pair_forces = 0;  // s
  mutable std::vector<std::string> said;

 private:
  SmallWorld& world_;
};

class SmallMemory : public Memory {
 public:
  explicit SmallMemory(SmallWorld& world) : world_(world) {}
  void freed(std::size_t bytes) override { bytes_freed += bytes; }
  void make_room(std::size_t granules) override { room_for = std::max(room_for, granules); }
  void give_rows_back(int) override {}
  bool too_large() const override { return large; }
  void fit() override;
  void fit_bins(bool some_stored) override { bins_wide = some_stored; }
  void give_bins_back() override { bins_wide = false; }
  void expect_stored(double largest_radius) override { expected = largest_radius; }

  std::size_t bytes_freed = 0, room_for = 0;
  bool large = false, bins_wide = false;
  double expected = 0;  // m
  int fits = 0;

 private:
  SmallWorld& world_;
};

class SmallWorld {
 public:
  explicit SmallWorld(const SmallDeck& its_deck, Meeting* meeting = nullptr, int rank = 0, int rank_count = 1);
  SmallWorld(const SmallWorld&) = delete;
  /// What some rank has, if one has. Collective.
  Woke any_woke(Woke here) const {
    double most = static_cast<double>(here);
    ranks.largest(&most, 1);
    return static_cast<Woke>(most);
  }

  SmallDeck deck;
  SmallAtoms atoms;
  SmallClumps clumps;
  SmallContacts contacts;
  SmallWalls walls;
  SmallInsertions insertions;
  SmallRanks ranks;
  SmallRun run;
  SmallMemory memory;

  Ports ports() { return {atoms, clumps, contacts, walls, insertions, ranks, run, memory}; }

  /// A granule, on the rank that owns its place; -1 elsewhere.
  int add(int tag, const Vec3& place, double radius, const Vec3& velocity = Vec3::Zero(), const Vec3& spin = Vec3::Zero());
  int at(int tag) const { return atoms.find(tag); }
  double mass_of(double radius) const;
  /// The shift of a periodic image that is nearest to `by`.
  Vec3 image_shift(const Vec3& by) const;
  /// What the engine does at a reneighbouring, but for its fixes: wrap, exchange, ghosts, lists. Collective.
  void reneighbour() {
    exchange();
    borders();
    contacts.build();
  }
  void exchange();
  void borders();
  void compute_forces();
  /// Called with the index of each granule that another rank has sent.
  std::function<void(int)> on_arrival;

  // --- with the culling's hooks, in the order of ARCHITECTURE.md's table. Collective.
  void follow(Culling& culling);
  void begin_run(Culling* culling);
  void step(Culling* culling);
  void steps(Culling* culling, int n) {
    for (; n > 0; --n) step(culling);
  }
  int builds = 0;  ///< neighbour lists built so far

  Vec3 momentum() const;          ///< of this rank's atoms, and of the clumps that it moves
  double kinetic_energy() const;  ///< likewise

 private:
  struct Ghost {
    int rank, index;
    Vec3 shift;
  };
  struct Row;
  std::vector<Row> owned_rows() const;
  void take_row(int i, const Row& row, const Vec3& shift);
  void refresh_ghosts();
  bool moved_too_far();
  void exchange_atoms();
  void integrate_first_half();
  void integrate_second_half();
  void kick(int i);

  std::vector<Ghost> ghosts_;
  std::vector<Vec3> built_at_;
};

/// One thread for each rank. The first exception of a rank is thrown again here, those that follow from it are not.
void run_on_ranks(const SmallDeck& deck, const std::function<void(SmallWorld&)>& work, double seconds = 20);

}  // namespace solidcull
