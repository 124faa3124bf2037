// Solid-state culling as a whole: owns its parts, and says in which order they act. Knows no engine but through the ports.
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <string>
#include <vector>

#include "between_runs.h"
#include "change.h"
#include "culling_parts.h"
#include "look.h"
#include "phase.h"

namespace solidcull {

/// Called by the adapter in the engine's hooks, in the order of a time step. All are collective unless they say otherwise.
/// InputError: the user's fault, on all ranks alike; RunFailure: the run's, on any rank; any other exception: ours.
/// What f_ID shows of an atom with `reasons yes`: its body, what keeps it awake, what woke it.
using Label = std::array<double, 3>;

class Culling {
 public:
  Culling(const Ports& ports, const Settings& settings, int types) : p_(ports, settings, types) {}
  Culling(const Culling&) = delete;

  // --- a run begins
  void begin_run();     ///< contact model, walls and box are known
  void set_up_atoms();  ///< atoms are there, neighbour lists are not
  void end_setup();     ///< forces are there, but for what other fixes add later

  // --- a time step
  void initial_step();  ///< takes the loads of a run's setup
  void integrate();     ///< bodies move, and carry their interface granules
  void change() {       ///< membership: only place where atoms come and go
    change_.make(look_, phase_);
    change_.send_far();
  }
  void take_neighbours();  ///< after the engine's exchange, when ghosts are there
  void note_new_lists() {  ///< local
    p_.freezing.note_new_lists();
    p_.audit.note_new_lists();
  }
  void leave_out_inner_pairs() {  ///< local
    if (!p_.freezing.inner_pairs_listed()) return;
    p_.meter.note_new_lists();
    const auto timed = p_.report.time(Part::load);
    p_.freezing.leave_out_inner_pairs();
  }
  /// In a step nothing is culled on any rank: initial_step(), integrate() and finish_step() would do nothing. Local.
  bool idles() const { return phase_ == Phase::stepping && !bed_.census.something_locked(); }
  bool may_ask_for_wall_loads() const;  ///< of the forces that are computed next. Local
  void take_forces();                   ///< after all forces: loads, wake-ups, a look
  void finish_step();                   ///< bodies have their velocities. Local
  void write_outputs();

  void end_run();

  // --- between runs, see BetweenRuns
  void show_bed() { between_.show_bed(); }  ///< local
  void finish_show() { between_.finish_show(); }
  void lend_contacts() { between_.lend_contacts(); }
  void take_contacts_back() { between_.take_contacts_back(); }
  bool culls_of(int groups) const { return between_.culls_of(groups); }
  void hide_bed() { between_.hide_bed(); }
  /// All granules become exterior. Returns how many were not, over all ranks.
  std::int64_t restore_all() { return between_.restore_all(phase_); }
  bool bed_is_shown() const { return p_.shown.shown(); }      ///< local
  bool waits_for_run() const { return p_.snapshot.waits(); }  ///< for what a restart file holds. Local
  /// What the last look chose to be culled is not known to rest any more: a command may do anything to granules. Local.
  void granules_may_change() { look_.granules_may_change(); }
  /// A program may, until the second call: then they are known to rest where it has not. Local.
  void remember_granules() { look_.remember_granules(); }
  void see_granules_again() { look_.see_granules_again(); }
  /// interface_meshes() stay as they are now until let_meshes_go(), whatever becomes of the granules. Local.
  void hold_meshes() {
    interface_meshes();
    p_.meshes.hold();
  }
  void let_meshes_go() { p_.meshes.let_go(); }

  // --- state
  double value(int n) { return p_.report.value(n); }                                              ///< f_ID[n + 1]
  const std::map<int, InterfaceMesh>& interface_meshes() { return between_.interface_meshes(); }  ///< local
  std::int64_t stored() const { return bed_.census.stored(); }  ///< interior granules of all ranks. Local
  double largest_radius(int type) const;                        ///< of what is or was stored (m). Local
  void enclose_stored(Box& box) const;                          ///< the box must not be smaller. Local
  double memory_bytes() const;                                  ///< local
  std::vector<double> restart_state();                          ///< on rank 0; the first number is how many
  /// What goes with the state of a restart file, at the end of the file.
  void append_restart(const std::string& file) { p_.snapshot.append_to(file); }
  /// file: what the state was read from.
  void read_restart_state(const char* bytes, const std::string& file) { p_.snapshot.read(Snapshot::from_bytes(bytes), file); }

  // --- what follows the engine's atoms; local
  const std::vector<FollowsAtoms*>& followers() { return p_.followers; }
  void arrived_from_another_rank(int i) { bed_.shell.mark_arriving(i); }
  void was_made(int i) { p_.closure.was_made(i); }  ///< by a fix that inserts, or any other way
  void read_from_file(int i) { p_.cover.forget(i); }
  double* labels() { return bed_.shell.labels(); }
  Label label_with_reasons(int i) const;

 private:
  void expect(std::initializer_list<Phase> phases, const char* where) const;
  void find_scales();
  void refuse_what_lies_too_far() const;
  void take_loads();
  bool stores_what_feels_walls();
  void tell_uneven_ranks();
  void collect_wakes();
  bool ask_for_those_that_wake();
  void hear_of_the_last_step(std::int64_t next_build);
  void open_for_insertion(std::int64_t step);

  CullingParts p_;
  Bed& bed_ = p_.bed;
  Look look_{p_};
  Change change_{p_};
  BetweenRuns between_{p_, change_, look_};
  Phase phase_ = Phase::between_runs;
  bool loads_are_none_ = false;  // nothing was culled when they were taken last
  bool asked_others_ = false;    // what this step has brought on other ranks is on its way
  bool has_collected_ = false;   // in this step, what wakes here
  std::string told_;             // the last line about ranks
};

}  // namespace solidcull
