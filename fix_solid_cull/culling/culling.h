// Solid-state culling as a whole: owns its parts, and says in which order they act. Knows no engine but through the ports.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <map>
#include <string>
#include <vector>

#include "culling_parts.h"
#include "proposal.h"

namespace solidcull {

/// Called by the adapter in the engine's hooks, in the order of a time step. All are collective unless they say otherwise.
/// InputError: the user's fault, on all ranks alike; RunFailure: the run's, on any rank; any other exception: ours.
class Culling {
 public:
  Culling(const Ports& ports, const Settings& settings, int types) : p_(ports, settings, types) {}
  Culling(const Culling&) = delete;

  // --- a run begins
  void begin_run();     ///< contact model, walls and box are known
  void set_up_atoms();  ///< atoms are there, neighbour lists are not
  void is_set_up();     ///< forces are there, but for what other fixes add later

  // --- a time step
  void initial_step();                                  ///< takes the loads of a run's setup
  void integrate();                                     ///< bodies move, and carry their interface granules
  void change();                                        ///< membership: only place where atoms come and go
  void take_neighbours();                               ///< after the engine's exchange, when ghosts are there
  void lists_are_new() { inner_pairs_listed_ = true; }  ///< local
  void leave_out_inner_pairs();                         ///< local
  /// In a step nothing is culled on any rank: initial_step(), integrate() and finish_step() would do nothing. Local.
  bool idles() const { return phase_ == Phase::stepping && !p_.bed.census.something_locked(); }
  bool may_ask_for_wall_loads() const;  ///< of the forces that are computed next. Local
  void take_forces();                   ///< after all forces: loads, wake-ups, a look
  void finish_step();                   ///< bodies have their velocities. Local
  void write_outputs();

  void end_run();

  // --- between runs
  /// All granules are atoms, as in the unculled deck, until hide_bed(); nothing if they are already, or none is culled. Local;
  /// finish_show() follows before the next collective function.
  void show_bed();
  /// What show_bed() leaves for later where it was called on one rank alone: the engine's map of tags, for one. Collective.
  void finish_show();
  /// The engine is about to compute forces of all granules, and has. Between them it has the contacts within bodies too.
  /// Collective.
  void lend_contacts();
  void take_contacts_back();
  /// A command may do anything to granules: what the last look chose to be culled is not known to rest any more. Local.
  void granules_may_change();
  /// A program may, until the second call: then they are known to rest where it has not. Local.
  void remember_granules();
  void see_granules_again();
  /// Whether a culled granule may be in one of these engine groups (bits). Collective.
  bool culls_of(int groups) const;
  /// What was culled and not changed is culled again; what was changed wakes when the run begins.
  void hide_bed();
  bool bed_is_shown() const { return p_.shown.shown(); }      ///< local
  bool waits_for_run() const { return p_.snapshot.waits(); }  ///< for what a restart file holds. Local
  /// interface_meshes() stay as they are now until let_meshes_go(), whatever becomes of the granules. Local.
  void hold_meshes();
  void let_meshes_go() { p_.meshes.let_go(); }
  /// All granules become exterior. Returns how many were not, over all ranks.
  std::int64_t restore_all();

  // --- state
  double value(int n) { return p_.report.value(n); }              ///< f_ID[n + 1]
  const std::map<int, InterfaceMesh>& interface_meshes();         ///< by body; between runs, as the last run left them. Local
  std::int64_t stored() const { return p_.bed.census.stored(); }  ///< interior granules of all ranks. Local
  double largest_radius(int type) const;                          ///< of what is or was stored (m). Local
  void enclose_stored(Box& box) const;                            ///< the box must not be smaller. Local
  double memory_bytes() const;                                    ///< local
  std::vector<double> restart_state();                            ///< on rank 0; the first number is how many
  /// What goes with the state of a restart file, at the end of the file.
  void append_restart(const std::string& file) { p_.snapshot.append_to(file); }
  /// file: what the state was read from.
  void read_restart_state(const char* bytes, const std::string& file) { p_.snapshot.read(Snapshot::from_bytes(bytes), file); }

  // --- what follows the engine's atoms; local
  const std::vector<FollowsAtoms*>& followers() { return p_.followers; }
  void arrived_from_another_rank(int i) { p_.bed.shell.is_arriving(i); }
  void was_made(int i) { p_.closure.was_made(i); }  ///< by a fix that inserts, or any other way
  void read_from_file(int i) { p_.cover.forget(i); }
  double* labels() { return p_.bed.shell.labels(); }

 private:
  enum class Phase {
    between_runs,
    beginning,  // of a run: nothing has been computed yet
    ready,      // set up; the first step takes the loads, in this run or, after `run 0`, in the next one
    stepping
  };
  void expect(std::initializer_list<Phase> phases, const char* where) const;
  std::uint64_t sum_of_granules() const;

  void find_scales();
  void leave_lists();
  void take_changes(bool other_walls);
  void follow_box();
  void take_arrivals();
  void settle_bodies();
  void refuse_what_lies_too_far() const;
  void see_walls(bool new_run);
  void take_loads();
  void store_what_feels_walls();
  void collect_wakes();
  void look();
  void look_at_once();
  Proposal survey(bool may_cull, bool any_culled);
  void ground_and_press();
  void judge(bool may_cull, const Proposal& proposal);
  void ask_for_build(std::int64_t step);
  void open_for_insertion(std::int64_t step);
  void meet_new_granules();
  void close_shell(bool changes, bool& shell_changed);
  void refill(bool& shell_changed);
  void store_and_fetch(const MembershipChange& c, bool changes, bool& shell_changed);
  void count_restored();
  void publish(const MembershipChange& c);
  void fit_memory();
  void hide_guests();

  CullingParts p_;
  Phase phase_ = Phase::between_runs;
  Proposal proposal_;  // of the last look, until the next change
  bool proposal_dropped_ = false;
  std::uint64_t granules_sum_ = 0;   // see remember_granules()
  bool inner_pairs_listed_ = false;  // the neighbour lists are new: pairs within bodies stand in them
  bool told_of_file_ = false;        // that restart files of this run hold more than atoms
  bool bodies_are_fast_ = false;     // some body may come too far between two times when ranks talk
  std::int64_t restored_then_ = 0;   // granules restored on this rank until culling was judged last
  bool surface_drawn_ = false;       // at the last look
  bool show_unfinished_ = false;     // the bed is shown on this rank, and other ranks may not know
  bool loads_are_none_ = false;      // nothing was culled when they were taken last
  bool walls_are_felt_ = true;       // since the run began, by what stands at them
};

}  // namespace solidcull
