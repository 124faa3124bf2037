// fix ID group-ID solid/cull [keyword value ...]: LIGGGHTS's hooks, handed on to the culling.
#pragma once

#include <cstdio>
#include <map>
#include <memory>
#include <string>

#include "atoms.h"
#include "clumps.h"
#include "contacts.h"
#include "culling.h"
#include "deck_rules.h"
#include "engine_memory.h"
#include "fix.h"
#include "insertions.h"
#include "interface_mesh_source.h"
#include "ranks.h"
#include "run.h"
#include "walls.h"

namespace solidcull {

class FixSolidCull : public LAMMPS_NS::Fix, public InterfaceMeshSource {
 public:
  FixSolidCull(LAMMPS_NS::LAMMPS* lmp, int narg, char** arg);
  ~FixSolidCull() override;

  int setmask() override;
  void pre_delete(bool unfix) override;
  void init() override;
  void setup_pre_exchange() override;
  void setup_pre_neighbor() override { pre_neighbor(); }
  void setup_pre_force(int) override;
  void setup(int) override;
  void pre_initial_integrate() override;
  void post_integrate() override;
  void pre_exchange() override;
  void pre_neighbor() override;
  void pre_force(int) override;
  void pre_final_integrate() override;
  void final_integrate() override;
  void end_of_step() override;
  void post_run() override;

  double compute_scalar() override;
  double compute_vector(int n) override;
  double memory_usage() override;
  void box_extent(double& xlo, double& xhi, double& ylo, double& yhi, double& zlo, double& zhi) override;
  double max_rad(int type) override;
  double extend_cut_ghost() override { return clumps_.largest(); }
  int min_type() override;
  int max_type() override;

  void grow_arrays(int nmax) override;
  void copy_arrays(int from, int to, int) override;
  void set_arrays(int i) override;
  int pack_exchange(int i, double* buffer) override;
  int unpack_exchange(int i, double* buffer) override;
  int pack_comm(int n, int* atoms, double* buffer, int, int*) override;
  void unpack_comm(int n, int first, double* buffer) override;
  int pack_restart(int i, double* buffer) override;
  void unpack_restart(int i, int nth) override;
  int size_restart(int) override { return maxsize_restart(); }
  int maxsize_restart() override;
  void write_restart(FILE* file) override;
  void restart(char* buffer) override;
  /// What is culled, at the end of the file whose head write_restart() has written. Collective.
  void append_restart(const std::string& file);

  const std::map<int, InterfaceMesh>& interface_meshes() override;

  // --- between runs; collective
  bool in_run() const { return in_run_; }
  void run_begins();
  void show_bed();
  /// On one rank alone; show_bed() on all follows before anything collective. Local.
  void show_bed_here();
  int show_number() const { return show_; }                       ///< which show of a bed it was the last time. Local
  bool bed_is_shown() const { return culling_->bed_is_shown(); }  ///< local
  std::int64_t stored() const { return culling_->stored(); }      ///< interior granules of all ranks. Local
  /// The engine computes forces of all granules between these two.
  void lend_contacts();
  void take_contacts_back();
  /// Ghosts learn which clumps they are of, as fix multisphere tells them at the builds of a run.
  void tell_ghosts_their_clumps();
  bool culls_of(int groups);
  void granules_may_change();
  /// A program may change them between these two. Local.
  void remember_granules();
  void see_granules_again();
  void keep_arrays() { memory_.keep_arrays(); }  ///< a program has pointers into them. Local
  void hide_bed();
  /// True if something was culled, which a line then says; nullptr: no line.
  bool restore_all(const char* command);
  /// The deck counts its steps anew, so much higher.
  void time_was_reset(std::int64_t by) { run_.reset_by += by; }
  /// A restart file was read, and what it holds besides atoms comes with the first run. Local.
  bool waits_for_run() const { return culling_->waits_for_run(); }
  std::string before_first_run(const std::string& where) const;  ///< the line that says so
  void refuse_value_of_atoms(const std::string& formula, const std::string& measured_by);

 private:
  void publish_labels();
  /// What goes wrong ends in one line, not in a stack trace.
  template <class Work>
  auto guarded(Work work) -> decltype(work());
  /// Likewise, and the ports are renewed before.
  template <class Work>
  auto hand_on(Work work) -> decltype(work());
  void renew();
  void reset_rows(int i);
  std::string line(const std::string& what) const;
  void refuse(const std::string& why);   // the user's fault; collective
  void broken(const std::string& what);  // ours; local
  void fail(const std::string& why);     // ends the run; local
  std::string where() const;             // rank and step
  void publish_flags();

  EngineAtoms atoms_;
  EngineClumps clumps_;
  EngineContacts contacts_;
  EngineWalls walls_;
  EngineInsertions insertions_;
  EngineRanks ranks_;
  EngineRun run_;
  EngineMemory memory_;
  DeckRules rules_;
  std::unique_ptr<Culling> culling_;
  bool in_run_ = false, reasons_ = false;
  std::vector<Label> label_rows_;  // of atoms, if they have reasons
  std::vector<double*> label_pointers_;
  int show_ = 0;
  int write_error_ = 0;  // of the restart file's head
};

}  // namespace solidcull
