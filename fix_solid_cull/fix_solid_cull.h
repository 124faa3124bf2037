// fix ID group-ID solid/cull [keyword value ...]: the adapter between LIGGGHTS's time step and the culling core.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "contact_histories.h"
#include "fix.h"
#include "flat_map.h"
#include "frozen_contacts.h"
#include "granule_records.h"
#include "granule_store.h"
#include "halo.h"
#include "implicit_surface.h"
#include "interface_mesh.h"
#include "interface_mesh_source.h"
#include "ledger.h"
#include "pair_force.h"
#include "settings.h"
#include "shell_entry.h"
#include "solid_bodies.h"
#include "solid_state.h"
#include "sphere_cells.h"
#include "stop_watch.h"
#include "wake_up.h"
#include "wall_contacts.h"

namespace solidcull {

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
  void pre_exchange() override;
  void pre_neighbor() override;
  void setup_pre_force(int) override;
  void pre_force(int) override;
  void pre_final_integrate() override;
  void end_of_step() override;
  void post_run() override;

  double compute_scalar() override;
  double compute_vector(int n) override;
  double memory_usage() override;
  double max_rad(int type) override;

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
  void refuse(const std::string& why);       // the user's fault; collective
  void broken(const std::string& what);      // ours; local
  void refuse_what_cannot_be_culled();
  void find_scales();
  Vec3 gravity() const;
  void leave_locked_pairs_out();
  void take_loads();
  void rebase_thawed_contacts();
  void ask_for_reneighbouring_if_waking();
  void check_invariants();                   // I1 and I2; local
  bool any_rank(bool here) const;
  void say(const std::string& line) const;
  double closing() const;        // radius of the ball that fits into no pore (m)
  double surface_reach() const;  // how far a granule can change another one's depth (m)

  // --- fix_solid_cull_look.cpp: what is in solid state, deep enough, exposed -----------------------------------------------
  void look();
  std::vector<char> find_quiet();
  void see_walls();
  void register_with_surface();
  void choose();
  void find_exposed();
  void prepare_locking();
  void schedule_next_look(std::int64_t chosen, std::int64_t exterior);
  void wake_where_walls_are_gone();

  // --- fix_solid_cull_membership.cpp: exterior <-> interface <-> interior --------------------------------------------------
  struct Ball {
    Vec3 centre;
    double radius;
  };
  void change_membership();
  std::vector<Ball> collect_balls();
  bool in_ball(const Vec3& x, double margin) const;
  void free_what_wakes(bool all);
  void lock_what_was_chosen();
  void tell_neighbours();
  void share_exterior();
  void keep_shell_closed();
  void freeze_contacts();
  void thaw_contacts();
  void store_what_is_deep();
  void publish_atom_counts();
  void label_bodies();
  void lock(int i);
  void unlock(int i);
  int bring_back(std::int64_t tag);
  void put_away(int i);
  void restore_all();
  void move_home();
  double contact_reach() const;
  void open_for_insertion();
  void check_inserted();
  std::map<int, int> global_bodies();
  GranuleMass mass_of(std::int64_t tag);
  Sphere sphere(int i) const;

  // --- fix_solid_cull_restart.cpp: the store as numbers, to a file or to another rank ---------------------------------------
  std::vector<double> serialise(const std::vector<std::int64_t>& tags) const;
  void take_up(const std::vector<double>& blocks);
  void take_up_restart_state();
  void found_bodies_anew();

  // --- fix_solid_cull_files.cpp: outputs -----------------------------------------------------------------------------------
  void update_meshes();
  void write_mesh_file(const std::string& pattern);
  void write_bed_file(const std::string& pattern);
  std::string file_of_step(const std::string& pattern) const;

  Settings settings_;
  Halo halo_;
  ContactHistories histories_;
  GranuleRecords records_;
  PairForce pair_force_;
  WallContacts walls_;

  // scales of the deck, found at the first run
  double diameter_ = 0;       // mean granule diameter (m)
  double weight_scale_ = 0;   // |g| (m/s^2)
  int look_every_ = 0;
  SolidStateLaw solid_state_{};
  WakeUpLaw wake_up_{};
  Vec3 gravity_at_locking_ = Vec3::Zero();

  // the solid
  std::vector<ShellEntry> shell_;  // by atom index
  std::unique_ptr<GranuleStore> store_;
  FrozenContacts contacts_;
  SolidBodies bodies_;
  Ledger ledger_;
  std::map<int, InterfaceMesh> meshes_;
  bool meshes_wanted_ = false;
  std::vector<double> largest_radius_by_type_;

  // the surface
  std::unique_ptr<ImplicitSurface> surface_;
  SphereCells around_;              // owned granules and halo at the last look
  std::vector<Sphere> plugs_;       // behind walls (walls closed)
  FlatMap<char> plugged_;
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
  FlatMap<double> normal_loads_;
  struct Touch {
    std::int64_t a, b;
  };
  std::vector<Touch> touches_;
  std::vector<Ball> waking_;
  bool wake_all_ = false;
  bool open_for_insertion_ = false;

  // the change under way
  std::vector<Ball> balls_;
  FlatMap<int> index_of_;
  std::vector<std::int64_t> freed_, locked_now_;
  std::vector<Sphere> halo_exterior_;
  std::int64_t stored_everywhere_ = 0;
  bool shell_reopened_ = false;     // the shell grew by granules that something came near to
  FlatMap<char> freed_anywhere_, locked_anywhere_, ghost_interface_;

  std::vector<int> locked_index_;   // atom indices of interface granules since the last reneighbouring
  bool locked_index_stale_ = true;
  bool lists_are_new_ = false;
  bool thawed_ = false;
  bool after_setup_ = false;
  bool new_run_ = false;
  int interface_group_ = -1;
  int look_factor_ = 1;             // looks less often where nothing can be culled
  bool told_no_worth_ = false;
  std::int64_t next_look_ = -1;
  std::int64_t membership_version_ = 0;
  double largest_excess_ = 0;
  std::vector<double> restart_state_;
  StopWatch watch_;
  std::vector<double> totals_;
  std::int64_t totals_step_ = -1, totals_version_ = -1;
};

}  // namespace solidcull
