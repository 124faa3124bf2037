#include "fix_solid_cull.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <exception>
#include <new>
#include <stdexcept>
#include <thread>
#include <vector>

#include "atom.h"
#include "comm.h"
#include "engine_access.h"
#include "error.h"
#include "input_error.h"
#include "interpositions.h"
#include "mesh_regions.h"
#include "modify.h"
#include "restart_files.h"
#include "run_failure.h"
#include "settings.h"
#include "solidcull.h"
#include "update.h"

namespace solidcull {

FixSolidCull::FixSolidCull(LAMMPS_NS::LAMMPS* lmp, int narg, char** arg)
    : Fix(lmp, narg, arg),
      atoms_(lmp, this),
      clumps_(lmp),
      contacts_(lmp),
      walls_(lmp),
      insertions_(lmp),
      ranks_(lmp),
      run_(lmp, this),
      memory_(lmp, atoms_, contacts_),
      rules_(lmp, this) {
  try {
    if (!engine::why_not_live().empty()) throw InputError(engine::why_not_live());
    const Settings settings = parse_settings(std::vector<std::string>(arg + 3, arg + narg));
    reasons_ = settings.reasons;
    rules_.refuse_what_was_set_up_wrongly();
    if (!atoms_.make_interface_group())
      throw InputError("all 32 groups are taken and interface granules need one: delete a group");
    clumps_.connect();
    box_change_domain = settings.balance_every > 0;  // the engine sets up its messages and meshes anew with each neighbour build
    culling_ = std::make_unique<Culling>(Ports{atoms_, clumps_, contacts_, walls_, insertions_, ranks_, run_, memory_}, settings,
                                         atom->ntypes);
  } catch (const InputError& e) {
    refuse(e.what());
  }
  publish_flags();
  grow_arrays(atom->nmax);
  for (int i = 0; i < atom->nmax; ++i) reset_rows(i);
  atom->add_callback(0);
  atom->add_callback(1);
  set_geometry_threads(std::max(1, static_cast<int>(std::thread::hardware_concurrency()) / comm->nprocs));
  run_.say(std::string("version ") + solidcull_version());
}

FixSolidCull::~FixSolidCull() {
  atom->delete_callback(id, 0);
  atom->delete_callback(id, 1);
}

/// What LIGGGHTS is to know of this fix.
void FixSolidCull::publish_flags() {
  scalar_flag = 1;
  vector_flag = 1;
  size_vector = Report::size;
  global_freq = 1;
  extscalar = 1;
  extvector = 0;
  peratom_flag = 1;
  size_peratom_cols = reasons_ ? static_cast<int>(Label().size()) : 0;
  peratom_freq = 1;
  force_reneighbor = 1;
  next_reneighbor = -1;
  nevery = 1;
  restart_global = 1;
  restart_peratom = 1;
  create_attribute = 1;
  comm_forward = 1;
}

int FixSolidCull::setmask() {
  using namespace LAMMPS_NS::FixConst;
  return PRE_INITIAL_INTEGRATE | POST_INTEGRATE | PRE_EXCHANGE | PRE_NEIGHBOR | PRE_FORCE | PRE_FINAL_INTEGRATE |
         FINAL_INTEGRATE | END_OF_STEP;
}

std::string FixSolidCull::line(const std::string& what) const { return "fix " + std::string(id) + " solid/cull: " + what; }

void FixSolidCull::refuse(const std::string& why) { error->all(__FILE__, __LINE__, line(why).c_str()); }

void FixSolidCull::broken(const std::string& what) {
  fail("internal error " + where() + ": " + what + "; please report it with the deck");
}

std::string FixSolidCull::where() const {
  return "on rank " + std::to_string(comm->me) + " at step " + std::to_string(update->ntimestep);
}

void FixSolidCull::fail(const std::string& why) {
  const std::string told = line(why);
  std::fprintf(stderr, "ERROR: %s\n", told.c_str());  // MPI_Abort drops what is buffered
  std::fflush(nullptr);
  error->one(__FILE__, __LINE__, told.c_str());
}

void FixSolidCull::renew() {
  atoms_.renew();
  contacts_.renew();
  run_.renew();
}

template <class Work>
auto FixSolidCull::guarded(Work work) -> decltype(work()) {
  try {
    return work();
  } catch (const InputError& e) {
    refuse(e.what());
  } catch (const RunFailure& e) {
    fail(where() + ": " + e.what());
  } catch (const std::range_error& e) {  // more than a container can hold
    fail(where() + ": " + e.what());
  } catch (const std::length_error& e) {
    fail(where() + ": " + e.what());
  } catch (const std::bad_alloc&) {
    fail(where() + ": no more memory; use more ranks, or store compact");
  } catch (const std::exception& e) {
    broken(e.what());
  }
  std::abort();  // all of these end the program
}

template <class Work>
auto FixSolidCull::hand_on(Work work) -> decltype(work()) {
  return guarded([&] {
    renew();
    return work();
  });
}

// ------------------------------------------------------------------------------------------------------------ a run begins

void FixSolidCull::init() {
  hand_on([&] {
    rules_.refuse_what_cannot_be_culled();
    engine::act_last_before_exchange(*modify, this);  // what others insert or delete there is seen at once
    clumps_.connect();
    contacts_.connect();
    walls_.connect();
    if (waits_for_run()) rules_.find_movable(atoms_, run_);  // write_restart takes up what a file holds, without a run
    culling_->begin_run();
  });
}

void FixSolidCull::setup_pre_exchange() {
  bodies_have_changed();
  hand_on([&] { culling_->set_up_atoms(); });
}

void FixSolidCull::setup_pre_force(int vflag) {
  guarded([&] { culling_->note_new_lists(); });
  pre_force(vflag);
}

void FixSolidCull::setup(int) {
  hand_on([&] { culling_->end_setup(); });
  publish_labels();
}

// ------------------------------------------------------------------------------------------------------------ a time step

void FixSolidCull::pre_initial_integrate() {
  if (culling_->idles()) return;
  hand_on([&] { culling_->initial_step(); });
}

void FixSolidCull::post_integrate() {
  if (culling_->idles()) return;
  hand_on([&] { culling_->integrate(); });
}

void FixSolidCull::pre_exchange() {
  bodies_have_changed();
  hand_on([&] { culling_->change(); });
  publish_labels();  // arrays may have been cut
}

void FixSolidCull::pre_neighbor() {
  hand_on([&] { culling_->take_neighbours(); });
}

void FixSolidCull::pre_force(int) {
  hand_on([&] {
    walls_.begin_step(culling_->may_ask_for_wall_loads());
    culling_->leave_out_inner_pairs();
  });
}

void FixSolidCull::pre_final_integrate() {
  hand_on([&] { culling_->take_forces(); });
}

void FixSolidCull::final_integrate() {
  if (culling_->idles()) return;
  hand_on([&] { culling_->finish_step(); });
}

void FixSolidCull::end_of_step() {
  hand_on([&] { culling_->write_outputs(); });
  publish_labels();
}

void FixSolidCull::post_run() {
  in_run_ = false;
  hand_on([&] { culling_->end_run(); });
}

void FixSolidCull::pre_delete(bool unfix) {
  if (unfix) hand_on([&] { culling_->restore_all(); });
}

// ------------------------------------------------------------------------------------------------------------ between runs

void FixSolidCull::run_begins() {
  atoms_.connect();
  hand_on([&] {
    if (rules_.find_movable(atoms_, run_)) culling_->show_bed();  // to see who may still be culled
    culling_->hide_bed();
    culling_->let_meshes_go();
  });
  bodies_have_changed();
  in_run_ = true;
}

void FixSolidCull::show_bed_here() {
  const bool before = culling_->bed_is_shown();
  hand_on([&] {
    if (!before && has_interface_mesh(lmp)) culling_->hold_meshes();
    culling_->show_bed();
  });
  static int all = 0;  // of all fixes in this process
  if (culling_->bed_is_shown() && !before) show_ = ++all;
}

void FixSolidCull::show_bed() {
  show_bed_here();
  hand_on([&] { culling_->finish_show(); });
  publish_labels();
}

void FixSolidCull::lend_contacts() {
  hand_on([&] { culling_->lend_contacts(); });
}

void FixSolidCull::take_contacts_back() {
  hand_on([&] { culling_->take_contacts_back(); });
}

void FixSolidCull::tell_ghosts_their_clumps() {
  if (clumps_.possible) comm->forward_comm_fix(this);
}

int FixSolidCull::pack_comm(int n, int* atoms, double* buffer, int, int*) {
  for (int k = 0; k < n; ++k) buffer[k] = clumps_.of(atoms[k]);
  return 1;
}

void FixSolidCull::unpack_comm(int n, int first, double* buffer) {
  for (int k = 0; k < n; ++k) clumps_.set_clump(first + k, static_cast<int>(buffer[k]));
}

void FixSolidCull::granules_may_change() {
  hand_on([&] { culling_->granules_may_change(); });
}

void FixSolidCull::remember_granules() {
  hand_on([&] { culling_->remember_granules(); });
}

void FixSolidCull::see_granules_again() {
  hand_on([&] { culling_->see_granules_again(); });
}

bool FixSolidCull::culls_of(int groups) {
  return hand_on([&] { return culling_->culls_of(groups); });
}

void FixSolidCull::hide_bed() {
  hand_on([&] { culling_->hide_bed(); });
}

bool FixSolidCull::restore_all(const char* command) {
  const bool some = hand_on([&] {
    if (command && has_interface_mesh(lmp)) culling_->hold_meshes();
    return culling_->restore_all() > 0;
  });
  if (some && command) run_.say("'" + std::string(command) + "' may change which granules there are: all are exterior now");
  publish_labels();
  return some;
}

std::string FixSolidCull::before_first_run(const std::string& where) const {
  return line("the granules that the restart file holds besides the atoms come with the first run: put 'run 0' " + where);
}

void FixSolidCull::refuse_value_of_atoms(const std::string& formula, const std::string& measured_by) {
  refuse("the variable '" + formula + "' reads " + measured_by +
         ", which has measured atoms only, without the granules that are culled: read what it is made of, which is computed "
         "again of all "
         "granules, or one of f_" +
         id + "[23] to f_" + id + "[28]");
}

// ------------------------------------------------------------------------------------------------------------ state

double FixSolidCull::compute_scalar() { return compute_vector(Report::interior); }

double FixSolidCull::compute_vector(int n) {
  return hand_on([&] { return culling_->value(n); });
}

double FixSolidCull::memory_usage() {
  return guarded([&] { return culling_->memory_bytes(); });
}

double FixSolidCull::max_rad(int type) {
  return guarded([&] { return culling_->largest_radius(type); });
}

/// A box that follows the granules (boundary m, s) follows stored ones too.
void FixSolidCull::box_extent(double& xlo, double& xhi, double& ylo, double& yhi, double& zlo, double& zhi) {
  Box box{{xlo, ylo, zlo}, {xhi, yhi, zhi}};
  guarded([&] { culling_->enclose_stored(box); });
  xlo = box.lo[0], ylo = box.lo[1], zlo = box.lo[2];
  xhi = box.hi[0], yhi = box.hi[1], zhi = box.hi[2];
}

const std::map<int, InterfaceMesh>& FixSolidCull::interface_meshes() {
  using Meshes = std::map<int, InterfaceMesh>;
  return *hand_on([&]() -> const Meshes* { return &culling_->interface_meshes(); });
}

// the engine makes the tables of its contact models for the types that it sees among its atoms and that fixes name: a run may
// start with all granules of a type in the store
int FixSolidCull::min_type() {
  for (int type = 1; type <= atom->ntypes; ++type)
    if (culling_->largest_radius(type) > 0) return type;
  return 0;
}

int FixSolidCull::max_type() {
  for (int type = atom->ntypes; type > 0; --type)
    if (culling_->largest_radius(type) > 0) return type;
  return 0;
}

// ------------------------------------------------------------------------------------------------------------ per atom

/// For dumps, and whatever reads f_ID of atoms. Arrays of the engine's room.
void FixSolidCull::publish_labels() {
  if (size_peratom_cols == 0) {
    vector_atom = culling_->labels();
    return;
  }
  label_rows_.resize(static_cast<std::size_t>(atom->nmax));
  label_pointers_.resize(label_rows_.size());
  for (int i = 0; i < atom->nlocal; ++i) label_rows_[i] = culling_->label_with_reasons(i);
  std::transform(label_rows_.begin(), label_rows_.end(), label_pointers_.begin(), [](auto& row) { return row.data(); });
  array_atom = label_pointers_.data();
}

void FixSolidCull::grow_arrays(int nmax) {
  guarded([&] {
    for (FollowsAtoms* f : culling_->followers()) f->grow(nmax);
  });
  publish_labels();
}

void FixSolidCull::copy_arrays(int from, int to, int) {
  guarded([&] {
    for (FollowsAtoms* f : culling_->followers()) f->copy(from, to);
  });
}

void FixSolidCull::reset_rows(int i) {
  for (FollowsAtoms* f : culling_->followers()) f->reset(i);
}

void FixSolidCull::set_arrays(int i) {
  guarded([&] {
    reset_rows(i);
    if (!atoms_.puts_back()) culling_->was_made(i);
  });
}

int FixSolidCull::pack_exchange(int i, double* buffer) {
  return guarded([&] {
    int n = 0;
    for (const FollowsAtoms* f : culling_->followers()) {
      f->pack(i, buffer + n);
      n += f->packed_size();
    }
    return n;
  });
}

int FixSolidCull::unpack_exchange(int i, double* buffer) {
  return guarded([&] {
    int n = 0;
    for (FollowsAtoms* f : culling_->followers()) {
      f->unpack(i, buffer + n);
      n += f->packed_size();
    }
    culling_->arrived_from_another_rank(i);
    return n;
  });
}

// ------------------------------------------------------------------------------------------------------------ restart

int FixSolidCull::maxsize_restart() {
  int n = 1;
  for (const FollowsAtoms* f : culling_->followers()) n += f->packed_size();
  return n;
}

int FixSolidCull::pack_restart(int i, double* buffer) {
  buffer[0] = 1 + pack_exchange(i, buffer + 1);
  return static_cast<int>(buffer[0]);
}

void FixSolidCull::unpack_restart(int i, int nth) {
  double* const extra = atom->extra[i];
  int at = 0;
  for (int k = 0; k < nth; ++k) at += static_cast<int>(extra[at]);
  ++at;
  guarded([&] {
    for (FollowsAtoms* f : culling_->followers()) {
      f->unpack(i, extra + at);
      at += f->packed_size();
    }
    culling_->read_from_file(i);
  });
}

void FixSolidCull::write_restart(FILE* file) {
  const std::vector<double> state = hand_on([&] { return culling_->restart_state(); });
  if (comm->me != 0) return;
  const int bytes = static_cast<int>(state.size() * sizeof(double));
  errno = 0;
  const bool written = std::fwrite(&bytes, sizeof(int), 1, file) == 1 &&
                       std::fwrite(state.data(), sizeof(double), state.size(), file) == state.size() && std::fflush(file) == 0;
  write_error_ = written ? 0 : errno ? errno : EIO;
}

void FixSolidCull::append_restart(const std::string& file) {
  hand_on([&] {
    std::int64_t error = write_error_;
    ranks_.largest(&error, 1);
    try {
      if (error)
        throw InputError("the restart file could not be written (" + std::string(std::strerror(static_cast<int>(error))) +
                         "): make room, or write it elsewhere");
      culling_->append_restart(file);
    } catch (const InputError&) {
      if (comm->me == 0) std::remove(file.c_str());
      throw;
    }
  });
}

void FixSolidCull::restart(char* buffer) {
  hand_on([&] { culling_->read_restart_state(buffer, file_that_was_read(lmp)); });
}

}  // namespace solidcull
