// fix ID group-ID solid/cull [keyword value ...]: the adapter between LIGGGHTS's time step and the culling core.
#pragma once

#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "contact_histories.h"
#include "engine_memory.h"
#include "fix.h"
#include "flat_map.h"
#include "frozen_contacts.h"
#include "frozen_wall_loads.h"
#include "granule_records.h"
#include "granule_store.h"
#include "halo.h"
#include "implicit_surface.h"
#include "interface_mesh.h"
#include "interface_mesh_source.h"
#include "ledger.h"
#include "mesh_loads.h"
#include "packed_history.h"
#include "pair_force.h"
#include "settings.h"
#include "shell_entry.h"
#include "solid_bodies.h"
#include "solid_state.h"
#include "sphere_cells.h"
#include "stop_watch.h"
#include "tag_index.h"
#include "wake_up.h"
#include "wall_contacts.h"
#include "worth.h"

namespace solidcull {

/// Largest way (m) that a point of the box (body frame) has gone from one pose to the other.
double largest_way(const Pose& then, const Pose& now, const Vec3& lo, const Vec3& hi);

class FixSolidCull : public LAMMPS_NS::Fix, public InterfaceMeshSource {
 public:
  FixSolidCull(LAMMPS_NS::LAMMPS* lmp, int narg, char** arg);
  ~FixSolidCull() override;

  int setmask() override;
  void pre_delete(bool unfix) override;
  void init() override;
  void setup(int) override;
  void setup_pre_exchange() override;
  void pre_initial_integrate() override;
  void post_integrate() override;
  void pre_exchange() override;
  void pre_neighbor() override;
  void setup_pre_neighbor() override { pre_neighbor(); }
  void setup_pre_force(int) override;
  void pre_force(int) override;
  void pre_final_integrate() override;
  void final_integrate() override;
  void end_of_step() override;
  void post_run() override;

  double compute_scalar() override;
  double compute_vector(int n) override;
  double memory_usage() override;
  double max_rad(int type) override;
  int min_type() override;
  int max_type() override;

  void grow_arrays(int nmax) override;
  void copy_arrays(int from, int to, int) override;
  void set_arrays(int i) override;
  int pack_exchange(int i, double* buffer) override;
  int unpack_exchange(int i, double* buffer) override;
  int pack_restart(int i, double* buffer) override;
  void unpack_restart(int i, int nth) override;
  int size_restart(int) override;
  int maxsize_restart() override;
  void write_restart(FILE* file) override;
  void restart(char* buffer) override;

  const std::map<int, InterfaceMesh>& interface_meshes() override;

 private:
  // --- fix_solid_cull.cpp: the hooks, refusals, scales --------------------------------------------------------------------
  void refuse(const std::string& why);   // the user's fault; collective
  void broken(const std::string& what);  // ours; local
  /// What must not happen ends in one line, not in a stack trace.
  template <class Work>
  void guarded(Work work) {
    try {
      work();
    } catch (const std::exception& e) {
      broken(e.what());
    }
  }
  void refuse_what_cannot_be_culled();
  void refuse_what_lies_too_far();
  void find_scales();
  void find_movable();
  Vec3 gravity() const;
  void leave_locked_pairs_out();
  void rebase_thawed_contacts();
  void ask_for_reneighbouring_if_waking();
  void check_invariants();  // I1 and I2; local
  void count_totals();
  void sum_carried();
  bool any_rank(bool here) const;
  void say(const std::string& line) const;
  double closing() const;        // radius of the ball that fits into no pore (m)
  double surface_reach() const;  // how far a granule can change another one's depth (m)

  bool rigid() const { return settings_.motion == Motion::rigid; }
  bool sleeping() const { return settings_.exterior == Exterior::sleep; }
  bool compact() const { return settings_.store == Store::compact; }
  bool needs_surface() const { return settings_.exterior == Exterior::live; }

  // --- fix_solid_cull_bodies.cpp: how solid bodies move -------------------------------------------------------------------
  struct ActiveBody {
    int number;
    SolidBody* body;
    bool stands = false;         // grounded, or all bodies are fixed
    Vec3 change = Vec3::Zero();  // if it stands: what its walls must bear beyond what is frozen, for it is in balance (N)
    Vec3 force = Vec3::Zero(),
         torque = Vec3::Zero();  // N and N m about the centre of mass, of the whole body; if it does not stand
    double reach = 0,
           way = 0;  // of its interior granules: farthest from the centre; bound of their way since the last reneighbouring (m)
    int spanning = -1;  // its place among the bodies that span ranks
  };
  struct Group {
    int key;     // the body's number on all ranks
    Vec3 shift;  // brings this rank's part to the image in which the whole is summed (m)
  };
  struct FieldInFrame;
  void refresh_locked();
  std::vector<FieldInFrame> fields_of_bodies() const;
  void add_to_body(std::size_t k, const Vec3& contact, const double* torque);
  void take_loads();
  void sum_over_bodies();
  double way_in_a_step(const ActiveBody& a) const;
  bool body_comes_too_far(int steps) const;
  bool body_is_fast(int steps) const;
  void place_interface_granules();
  void give_velocities();
  void give_velocity(std::size_t k, const std::vector<FieldInFrame>& fields);
  void follow_loads(int swallowed, int kept);
  void settle_bodies();
  void adopt_places();
  std::vector<std::int64_t> stored_at_borders() const;
  void group_bodies();
  int key_of(int body) const;
  int key_of_atom(int i) const;  // owned or ghost; 0: exterior
  void watch_effective_gravity(bool new_gravity);
  void wake_body(int key);
  void hand_over();
  void take_over_atoms();
  void fetch_from_outside();
  void forget_lost_atoms();
  void split_bodies();
  double kinetic_energy(int body) const;
  Vec3 nearest_image(const Vec3& x, const Vec3& to) const;
  Vec3 in_world(const Resident& g) const { return bodies_.pose(g.body).to_world(g.position); }
  double store_slack() const;  // how far outside its subdomain a rank may hold a stored granule (m)
  /// Of a frame of the store: that of its body, or the world.
  const Pose& pose_of_frame(int frame) const {
    static const Pose world;
    return frame == GranuleStore::shared_frame ? world : bodies_.pose(frame);
  }

  /// Stored granules whose surface is closer than `gap` to the sphere's (world frame), but for those of the body `except` (a
  /// key).
  template <class Visit>
  void for_each_stored_near(const Sphere& s, double gap, Visit visit, int except = 0) const {
    store_->for_each_frame([&](int frame, const Vec3&, const Vec3&) {
      const bool shared = frame == GranuleStore::shared_frame;
      if (except && !shared && key_of(frame) == except) return;
      const Pose& pose = pose_of_frame(frame);
      for (const Vec3& shift : halo_.image_shifts())
        store_->for_each_near(frame, {pose.to_frame(s.centre + shift), s.radius}, gap, [&](const Resident& g) {
          if (!except || !shared || key_of(g.body) != except) visit(g);
        });
    });
  }
  /// Stored granules in the box (world frame), and some around it; of one frame, if one is given.
  template <class Visit>
  void for_each_stored_in_box(const Vec3& lo, const Vec3& hi, Visit visit, int only = -1) const {
    const Vec3 middle = 0.5 * (lo + hi), half = 0.5 * (hi - lo);
    store_->for_each_frame([&](int frame, const Vec3&, const Vec3&) {
      if (only >= 0 && frame != only) return;
      const Pose& pose = pose_of_frame(frame);
      const Vec3 reach = turned_half_box(pose.turn().transpose(), half);
      for (const Vec3& shift : halo_.image_shifts()) {
        const Vec3 at = pose.to_frame(middle + shift);
        store_->for_each_in_box(frame, at - reach, at + reach, visit);
      }
    });
  }

  // --- fix_solid_cull_ground.cpp: bodies that walls hold --------------------------------------------------------------------
  bool stands_still(int body) const;  // its granules at still walls may go to the store
  void ground_bodies();
  void set_grounded(int body, bool on);
  void ground_one(int body, int i);
  bool walls_bear(int body) const;
  std::vector<WallLoad> wall_loads_on(int i);
  void share_out_loads();
  void press_on_walls();
  void find_frame(int body);
  void forget_body(int body);

  // --- fix_solid_cull_look.cpp: what is in solid state, deep enough, exposed -----------------------------------------------
  void look();
  std::vector<char> find_steady(const std::vector<char>& asked);
  void leave_out_what_is_not_steady();
  bool calm_enough(int i) const;
  void choose_asleep();
  std::int64_t find_calm();
  bool can_be_culled(int mask) const;
  void pause_where_bodies_wake();
  std::vector<Vec3> accelerations() const;
  void follow_with_surface();
  void see_walls(bool new_run);
  void register_with_surface();
  void choose();
  void find_exposed();
  void prepare_locking();
  void judge_worth(std::int64_t chosen, std::int64_t exterior);
  void schedule_next_look();
  double kinetic_energy_of_exterior() const;
  void come_back_where_it_calmed();
  bool looks_quickly() const;
  int looks_in_a_row() const;
  int quick_interval() const;
  void ask_for_build(std::int64_t step);

  // --- fix_solid_cull_membership.cpp: exterior <-> interface <-> interior --------------------------------------------------
  struct Foreign {
    Sphere sphere;
    int body;     // key; 0: exterior
    bool stands;  // the body does
  };
  struct Ball {
    Vec3 centre;
    double radius;
  };
  void index_atoms();
  void change_membership();
  std::vector<Ball> collect_balls();
  bool in_ball(const Vec3& x, double margin) const;
  void free_what_wakes(bool all);
  void lock_what_was_chosen();
  void tell_neighbours();
  void count_bodies();
  void share_exterior();
  Foreign as_foreign(int i) const;
  bool frame_stands(int frame) const;
  bool is_clear(int i) const;
  void keep_shell_closed();
  bool just_locked(int i) const;
  void freeze_contacts();
  void freeze_inner_contacts();
  void freeze_histories();
  void share_bodies();
  void thaw_contacts();
  void lock_into_bodies();
  void free_from_bodies();
  void store_what_is_deep(bool change);
  void fit_memory();
  void publish_atom_counts();
  void label_bodies();
  void lock(int i);
  void unlock(int i);
  void clear_map();
  int bring_back(std::int64_t tag);
  void put_away(int i);
  Vec3 apart(const Resident& a, const Resident& b) const;
  bool inner_history(const Resident& g, std::int64_t partner, double* history) const;
  void turn_inner_histories(int body, const Eigen::Matrix3d& by);
  void entered_store(std::int64_t tag);
  void leaves_store(std::int64_t tag);
  void make_store();
  std::size_t locked_here() const;
  bool may_leave_its_walls(const ShellEntry& e) const;
  void restore_all();
  void move_home();
  double contact_reach() const;
  void open_for_insertion();
  void check_inserted();
  std::vector<WallContacts::Box> insertion_boxes(bool now) const;
  void fetch_near_walls(std::set<std::int64_t>& near);
  GranuleMass mass_of(std::int64_t tag) const;
  MovingGranule moving(int i) const;
  Sphere sphere(int i) const;

  // --- fix_solid_cull_restart.cpp: the store as numbers, to a file or to another rank ---------------------------------------
  struct Block;  // what one rank wrote
  std::vector<double> serialise(const std::vector<std::int64_t>& stored, const std::vector<std::int64_t>& atoms, bool all) const;
  std::vector<Block> parse_blocks(const std::vector<double>& numbers, std::size_t from, std::size_t width);
  bool is_mine(const Block& b) const;
  void take_up_as_it_was(const Block& b);
  void take_up(const std::vector<Block>& blocks);
  void publish_restored();
  void know_radius(int type, double radius);
  void take_up_restart_state();

  // --- fix_solid_cull_files.cpp: outputs -----------------------------------------------------------------------------------
  void update_meshes();
  const Pose& pose_of_mesh(int body) const;
  void write_mesh_file(const std::string& pattern);
  void write_bed_file(const std::string& pattern);
  std::string file_of_step(const std::string& pattern) const;

  Settings settings_;
  Halo halo_;
  ContactHistories histories_;
  GranuleRecords records_;
  PairForce pair_force_;
  WallContacts walls_;
  MeshLoads mesh_loads_;
  EngineMemory memory_;

  // scales of the deck, found at the first run
  double diameter_ = 0;      // mean granule diameter (m)
  double weight_scale_ = 0;  // |g| (m/s^2)
  int look_every_ = 0;
  SolidStateLaw solid_state_{};
  WakeUpLaw wake_up_{};
  Vec3 gravity_then_ = Vec3::Zero();  // at the last look
  int movable_ = 0;                   // bits of groups that an integrator moves
  int gravity_bit_ = 0;               // bits of groups that gravity pulls
  int held_ = 0;                      // bits of groups that some fix holds or drives: never culled
  int pause_ = 0;                     // looks that culling waits after a body woke as a whole; doubles while that goes on
  std::int64_t no_cull_until_ = -1;

  // the solid
  std::vector<ShellEntry> shell_;  // by atom index
  std::unique_ptr<GranuleStore> store_;
  FrozenContacts contacts_;
  PackedHistory packed_;  // of contacts in a compact store: in the tail of the granule that went in later
  SolidBodies bodies_;
  FrozenWallLoads wall_loads_;  // of stored granules
  struct Sum {
    Vec3 value = Vec3::Zero();
  };
  FlatMap<int> rested_;    // body -> looks in a row at which it was at rest at a wall that stands still
  FlatMap<Sum> pressed_;   // grounded body -> running mean of what its walls bear beyond what is frozen (N)
  std::set<int> lifting_;  // grounded bodies that the walls might not hold any more
  Ledger ledger_;
  std::map<int, InterfaceMesh> meshes_;
  bool meshes_wanted_ = false;
  struct Merge {
    int kept, swallowed;
    Pose pose;  // of the swallowed one
  };
  std::vector<Merge> merges_;  // in the last change: what happened to their meshes
  std::vector<double> largest_radius_by_type_;

  // the surface
  std::unique_ptr<ImplicitSurface> surface_;
  SphereCells around_;         // owned granules and halo at the last look
  std::vector<Sphere> plugs_;  // behind still walls (walls closed); world frame
  FlatMap<char> plugged_;
  FlatMap<Sphere> moving_plugs_;  // behind walls that can move, as seen at the last look; the observer's frame
  std::vector<std::string> walls_then_;
  SphereCells plug_cells_;
  bool plugs_changed_ = false;
  bool halo_drawn_ = false;
  std::int64_t drawn_at_last_look_ = 0;
  FlatMap<char> overdue_;

  // decisions waiting for the next reneighbouring
  std::vector<std::int64_t> chosen_;
  struct SideChange {
    std::int64_t interface_tag, other_tag;
    Vec3 force;
  };
  std::vector<SideChange> side_changes_;
  struct Touch {
    std::int64_t a, b;
  };
  std::vector<Touch> touches_;
  std::vector<Ball> waking_;
  bool wake_all_ = false;
  bool open_for_insertion_ = false;

  // the change under way
  std::vector<Ball> balls_;
  TagIndex index_of_;
  std::vector<std::int64_t> freed_, locked_now_;
  std::vector<Foreign> halo_foreign_;  // other ranks' and periodic images' exterior and interface granules
  std::int64_t stored_everywhere_ = 0;
  std::int64_t locked_everywhere_ = 0;
  int store_bodies_ = 0;            // bodies on all ranks: with one alone, none can come near another
  bool store_asked_ = false;        // a look saw interface granules that nothing holds any more
  int builds_without_storing_ = 0;  // since they were last looked for
  std::size_t stay_near_ = 0;       // interface granules that stayed atoms the last time because something is near
  int clear_version_ = 0;       // what is stored in frames that stand has come there in other ways than put_away() since the last
  bool shell_changed_ = false;  // by granules that something came near to, or that nothing is near any more
  FlatMap<char> freed_anywhere_, locked_anywhere_;
  FlatMap<int> ghost_body_;      // tag -> key of the body of an interface ghost
  std::vector<int> freed_keys_;  // bodies that wake as a whole, by key, in this change
  std::vector<double> joins_;    // rows (place of a, a, b): resting against another body for long enough
  struct Arrival {
    SolidBodies::Place at;
    double mass = 0, radius = 0;
    bool held = false;
  };
  FlatMap<Arrival> arriving_;  // interface granules handed over by another rank in this reneighbouring

  struct Locked {
    std::int64_t tag;
    GranuleMass granule;
  };
  std::vector<Locked> locked_before_;  // interface granules of this rank when the engine was last given its atoms

  // bodies in motion
  std::vector<ActiveBody> active_;
  bool fast_bodies_ = false;     // some body may come too far between two times when ranks talk
  std::map<int, Group> groups_;  // local body -> the body that it is a part of; empty on one rank
  std::vector<int> spanning_;    // keys of bodies that span ranks, the same on all ranks
  std::map<int, std::array<bool, 3>> group_spans_;
  std::set<int> waking_bodies_;  // keys
  struct SeenWalls {
    Pose pose;                  // of the body, against still walls
    std::vector<Vec3> corners;  // of triangles that can move, seen from the body
  };
  std::map<int, SeenWalls> clear_of_walls_;  // when frames of the store were last compared with walls
  std::map<int, Pose> at_home_, drawn_;      // and with the ranks' subdomains and the surface
  Pose observer_;                            // the frame in which the implicit surface is drawn: that of the largest body
  int observed_ = 0;                         // that body
  Pose observed_then_;                       // where it was when the observer last followed

  std::vector<int> locked_index_;    // atom indices of interface granules since the last reneighbouring
  std::vector<int> locked_slot_;     // their bodies in active_
  std::vector<Vec3> locked_place_;   // and places there
  std::vector<std::size_t> riding_;  // those of them whose bodies move
  bool locked_index_stale_ = true;
  std::vector<int> motion_words_;  // of a record: what is of no worth once a step has passed
  // lock_step in a compact store, which needs to know no more
  static constexpr std::int64_t locked_long_ago = -1, locked_as_it_was_stored = -2;
  std::int64_t stored_at_ = -1;  // step in which granules last went into the store
  bool lists_are_new_ = false;
  bool map_cleared_ = false;
  bool thawed_ = false;
  bool after_setup_ = false;
  bool new_run_ = false;
  int interface_group_ = -1;
  WorthWatch worth_;
  std::int64_t judged_at_ = -1;     // step of the last judgement
  std::int64_t builds_asked_ = 0;   // neighbour lists built because this fix asked, since then
  std::int64_t restored_then_ = 0;  // granules restored until then
  bool told_no_worth_ = false;
  double energy_then_ = 0;  // kinetic energy of what was exterior when culling began to wait (J); 0: it does not
  int quick_looks_ = 0;     // left at the start of a run in which nothing is culled yet
  std::int64_t next_look_ = -1, last_look_ = INT32_MIN;
  std::int64_t membership_version_ = 0;
  double largest_excess_ = 0;
  std::vector<double> restart_state_;
  StopWatch watch_;
  static constexpr int counts = 12;  // f_ID[1..12]; after them what interior granules carry
  std::vector<double> totals_, carried_;
  std::int64_t totals_step_ = -1, totals_version_ = -1;
};

}  // namespace solidcull
