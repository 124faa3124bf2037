#include "fix_solid_cull.h"

#include <mpi.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <thread>

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "engine_access.h"
#include "engine_vectors.h"
#include "error.h"
#include "fix_gravity.h"
#include "fix_insert.h"
#include "force.h"
#include "group.h"
#include "input_error.h"
#include "memory.h"
#include "modify.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "pair_gran.h"
#include "update.h"

namespace solidcull {
namespace {

// waking granules are handled together after about so many steps: a sound wave crosses one or two granules in that time
constexpr int wake_together = 20;
// but a load change of so many tolerances at once
constexpr double blow = 10;
// pores of a packing hold no ball of this radius (in mean diameters); a hole that holds one is open to the outside
constexpr double closing_diameters = 0.6;
// in a run that starts with an empty box, steps between two tries to find granules to take the scales from
constexpr int first_granules_every = 50;
constexpr double standard_gravity = 9.81;  // m/s^2, the scale where the deck has none

/// Invariants are checked at every reneighbouring in debug builds, and in any build when SOLIDCULL_CHECK is in the environment.
bool checking() {
#ifdef NDEBUG
  static const bool asked = std::getenv("SOLIDCULL_CHECK") != nullptr;
  return asked;
#else
  return true;
#endif
}

Settings parse(int narg, char** arg, LAMMPS_NS::Error* error, const char* id) {
  try {
    return parse_settings(std::vector<std::string>(arg + 3, arg + narg));
  } catch (const InputError& e) {
    const std::string line = "fix " + std::string(id) + " solid/cull: " + e.what();
    error->all(__FILE__, __LINE__, line.c_str());
  }
  return {};
}

}  // namespace

FixSolidCull::FixSolidCull(LAMMPS_NS::LAMMPS* lmp, int narg, char** arg)
    : Fix(lmp, narg, arg),
      settings_(parse(narg, arg, error, arg[0])),
      halo_(lmp),
      histories_(lmp),
      records_(lmp, this),
      pair_force_(lmp),
      walls_(lmp),
      mesh_loads_(lmp),
      memory_(lmp) {
  if (domain->triclinic) refuse("the box is triclinic: use an orthogonal one");
  if (force->newton_pair) refuse("newton is on: put 'newton off' at the top of the deck");
  if (!atom->radius_flag || !atom->rmass_flag || !atom->omega_flag || !atom->sphere_flag)
    refuse("atom style '" + std::string(atom->atom_style) + "' has no granules: use atom_style granular");
  if (!atom->tag_enable) refuse("atoms have no tags: use an atom style that has them, as granular does");
  for (int f = 0; f < modify->nfix; ++f)
    if (modify->fix[f] && std::strcmp(modify->fix[f]->style, style) == 0 && std::strcmp(modify->fix[f]->id, id) != 0)
      refuse("fix " + std::string(modify->fix[f]->id) + " is a solid/cull already: give one fix a group that holds all granules");

  scalar_flag = 1;
  vector_flag = 1;
  size_vector = counts + 10;
  global_freq = 1;
  extscalar = 1;
  extvector = 0;
  peratom_flag = 1;
  size_peratom_cols = 0;
  peratom_freq = 1;
  force_reneighbor = 1;
  next_reneighbor = -1;
  nevery = 1;
  restart_global = 1;
  restart_peratom = 1;
  create_attribute = 1;

  const std::string name = std::string(id) + "_interface";
  interface_group_ = group->find(name.c_str());
  if (interface_group_ < 0) {
    if (group->ngroup >= 32) refuse("all 32 groups are taken and interface granules need one: delete a group");
    std::vector<std::string> words = {name, "subtract", "all", "all"};
    std::vector<char*> args;
    for (std::string& w : words) args.push_back(&w[0]);
    group->assign(static_cast<int>(args.size()), args.data());
    interface_group_ = group->find(name.c_str());
  }
  largest_radius_by_type_.assign(atom->ntypes + 1, 0.0);
  vector_atom = nullptr;
  grow_arrays(atom->nmax);
  for (int i = 0; i < atom->nmax; ++i) set_arrays(i);
  atom->add_callback(0);
  atom->add_callback(1);
  set_geometry_threads(std::max(1, static_cast<int>(std::thread::hardware_concurrency()) / comm->nprocs));
}

FixSolidCull::~FixSolidCull() {
  atom->delete_callback(id, 0);
  atom->delete_callback(id, 1);
  memory->destroy(vector_atom);
}

int FixSolidCull::setmask() {
  using namespace LAMMPS_NS::FixConst;
  return PRE_INITIAL_INTEGRATE | POST_INTEGRATE | PRE_EXCHANGE | PRE_NEIGHBOR | PRE_FORCE | PRE_FINAL_INTEGRATE |
         FINAL_INTEGRATE | END_OF_STEP;
}

void FixSolidCull::refuse(const std::string& why) {
  const std::string line = "fix " + std::string(id) + " solid/cull: " + why;
  error->all(__FILE__, __LINE__, line.c_str());
}

void FixSolidCull::broken(const std::string& what) {
  const std::string line = "fix " + std::string(id) + " solid/cull: internal error on rank " + std::to_string(comm->me) +
                           " at step " + std::to_string(update->ntimestep) + ": " + what + "; please report it with the deck";
  std::fprintf(stderr, "ERROR: %s\n", line.c_str());  // MPI_Abort drops what is buffered
  std::fflush(nullptr);
  error->one(__FILE__, __LINE__, line.c_str());
}

void FixSolidCull::say(const std::string& line) const {
  if (comm->me != 0) return;
  for (FILE* to : {screen, logfile})
    if (to) std::fprintf(to, "%s\n", line.c_str());
}

bool FixSolidCull::any_rank(bool here) const {
  if (comm->nprocs == 1) return here;
  int mine = here, anywhere = 0;
  MPI_Allreduce(&mine, &anywhere, 1, MPI_INT, MPI_MAX, world);
  return anywhere != 0;
}

double FixSolidCull::closing() const { return closing_diameters * diameter_; }

double FixSolidCull::surface_reach() const { return settings_.depth * diameter_ + 2 * closing() + 0.5 * contact_reach(); }

void FixSolidCull::pre_delete(bool unfix) {
  if (unfix && store_) guarded([&] { restore_all(); });
}

// ------------------------------------------------------------------------------------------------- at the start of a run

void FixSolidCull::refuse_what_cannot_be_culled() {
  if (force->newton_pair) refuse("newton is on: put 'newton off' at the top of the deck");
  if (std::strstr(update->integrate_style, "verlet") == nullptr)
    refuse("run_style '" + std::string(update->integrate_style) + "' is not supported: use run_style verlet");
  if (!force->pair || std::strncmp(force->pair_style, "gran", 4) != 0)
    refuse("pair_style '" + std::string(force->pair_style) + "' is not granular: use pair_style gran");
  if (domain->box_change_size || domain->box_change_shape)
    refuse("the box changes its size (fix deform, press/berendsen, ...): a culled bed cannot follow; leave that fix out");
  const auto* pair = static_cast<LAMMPS_NS::PairGran*>(force->pair);
  if (pair->storeContactForces())
    refuse("contact forces are stored per contact (store_force_contact): those of culled granules would be missing");

  struct Physics {
    const char* style;
    const char* why;
  };
  // physics that culled granules would miss; the styles are prefixes
  static const Physics missed[] = {
      {"heat/gran", "heat conduction would miss the culled granules"},
      {"couple/", "a coupled solver would miss the culled granules"},
      {"sph/", "SPH would miss the culled granules"},
      {"adapt", "radii that change (fix adapt) would leave the culled granules behind"},
      {"multisphere", "multisphere clumps are not supported yet"},
      {"rigid", "rigid clumps of granules are not supported yet"},
      {"nve/asphere", "aspherical granules are not supported"},
      {"nve/superquadric", "superquadric granules are not supported"},
      {"deform", "the box changes its size: a culled bed cannot follow"},
      {"bond", "bonds would miss the culled granules"},
  };
  for (int f = 0; f < modify->nfix; ++f) {
    const LAMMPS_NS::Fix* fix = modify->fix[f];
    for (const Physics& p : missed)
      if (std::strncmp(fix->style, p.style, std::strlen(p.style)) == 0)
        refuse("fix " + std::string(fix->id) + " " + fix->style + ": " + p.why + "; leave one of the two fixes out");
    if (std::strncmp(fix->style, "insert/", 7) == 0 && engine::compresses_tags(*static_cast<const LAMMPS_NS::FixInsert*>(fix)))
      refuse("fix " + std::string(fix->id) + " " + fix->style +
             ": compress_tags would renumber granules that are culled; say 'compress_tags no'");
  }
}

Vec3 FixSolidCull::gravity() const {
  Vec3 g = Vec3::Zero();
  for (int f = 0; f < modify->nfix; ++f)
    if (std::strcmp(modify->fix[f]->style, "gravity") == 0) {
      double one[3];
      static_cast<LAMMPS_NS::FixGravity*>(modify->fix[f])->get_gravity(one);
      g += vec(one);
    }
  return g;
}

void FixSolidCull::refuse_what_lies_too_far() {
  // twice the way to the farthest corner: places wait in the frames of bodies that may have moved through the box
  const Vec3 corner = vec(domain->boxlo).cwiseAbs().cwiseMax(vec(domain->boxhi).cwiseAbs());
  const double far = 2 * corner.norm(), farthest = GranuleStore::farthest * 2 * diameter_;
  if (far <= farthest) return;
  char told[64];
  std::snprintf(told, sizeof told, "%.4g m from the origin, and the box reaches %.4g m", farthest / 2, far / 2);
  refuse("store compact keeps places up to " + std::string(told) + ": move the origin to the granules, or use store exact");
}

void FixSolidCull::find_scales() {
  if (diameter_ == 0) {
    double sums[2] = {0, 0};
    for (int i = 0; i < atom->nlocal; ++i)
      if (atom->mask[i] & groupbit) {
        sums[0] += 2 * atom->radius[i];
        sums[1] += 1;
      }
    MPI_Allreduce(MPI_IN_PLACE, sums, 2, MPI_DOUBLE, MPI_SUM, world);
    if (sums[1] > 0) diameter_ = sums[0] / sums[1];
  }
  const double g = gravity().norm();
  if (g > 0) weight_scale_ = g;
  if (weight_scale_ == 0) {
    weight_scale_ = standard_gravity;
    say("fix " + std::string(id) +
        " solid/cull: the deck has no fix gravity; 'speed' and 'tolerance' are measured with 9.81 m/s^2");
  }
  if (diameter_ == 0) return;  // an empty box: the first granules set the scale
  const double d = diameter_;
  look_every_ = settings_.every ? settings_.every : look_interval(d, weight_scale_, update->dt);
  solid_state_ = {settings_.speed * std::sqrt(weight_scale_ * d),
                  SolidStateLaw::out_of_balance_share * std::max(settings_.tolerance_absolute, 1.0), weight_scale_};
  wake_up_ = {settings_.tolerance_absolute, settings_.tolerance_relative, weight_scale_, settings_.carve_radius * d,
              settings_.carve_cap};
  if (!store_) {
    if (compact()) refuse_what_lies_too_far();
    make_store();
  }
  if (!surface_)
    surface_ = std::make_unique<ImplicitSurface>(
        settings_.voxel * d, closing(), [this](const Vec3& lo, const Vec3& hi, const std::function<void(const Sphere&)>& visit) {
          const auto from_cells = [&](const SphereCells& cells) {
            const Vec3 reach = Vec3::Constant(cells.largest_radius() + closing());
            cells.for_each_in_box(lo - reach, hi + reach, [&](std::size_t, const Sphere& s) {
              visit(s);
              return true;
            });
          };
          from_cells(around_);
          from_cells(plug_cells_);
          // the box is the observer's
          const Vec3 middle = observer_.to_world(0.5 * (lo + hi));
          const Vec3 half =
              turned_half_box(observer_.turn(), 0.5 * (hi - lo) + Vec3::Constant(store_->largest_radius() + closing()));
          for_each_stored_in_box(middle - half, middle + half, [&](const Resident& g) {
            visit({observer_.to_frame(nearest_image(in_world(g), middle)), g.radius});
          });
        });
}

void FixSolidCull::find_movable() {
  // only what an integrator moves and gravity pulls can be part of a solid body; what another fix holds or drives stays exterior
  static const char* holding[] = {"freeze", "setforce", "move", "planeforce", "lineforce", "aveforce"};
  static const char* driving[] = {"addforce", "drag", "efield", "spring", "buoyancy"};
  movable_ = held_ = gravity_bit_ = 0;
  const auto begins = [](const LAMMPS_NS::Fix* fix, const char* style) {
    return std::strncmp(fix->style, style, std::strlen(style)) == 0;
  };
  for (int f = 0; f < modify->nfix; ++f) {
    const LAMMPS_NS::Fix* fix = modify->fix[f];
    if (begins(fix, "nve")) movable_ |= fix->groupbit;
    if (begins(fix, "gravity")) gravity_bit_ |= fix->groupbit;
    for (const char* style : holding)
      if (begins(fix, style) && !begins(fix, "move/mesh")) held_ |= fix->groupbit;
    for (const char* style : driving)
      if (begins(fix, style)) {
        held_ |= fix->groupbit;
        say("fix " + std::string(id) + " solid/cull: fix " + fix->id + " (" + fix->style +
            ") adds forces that culled granules would miss: granules of its group are not culled");
      }
  }
}

void FixSolidCull::init() {
  refuse_what_cannot_be_culled();
  histories_.connect();
  walls_.connect();
  mesh_loads_.connect();
  const std::vector<bool> flips = histories_.flips();
  const bool some = contacts_.size() > 0 || (compact() && store_ && store_->size() > 0);
  if (some && flips != contacts_.layout())
    refuse("the contact model's history has changed from " + std::to_string(contacts_.width()) + " to " +
           std::to_string(flips.size()) + " numbers while granules are culled: unfix " + id + " before the pair_style changes");
  contacts_.set_layout(flips);
  contacts_.set_vectors(histories_.vectors());
  packed_.set_layout(contacts_.width(), contacts_.vectors());
  find_movable();
  halo_.update();
  bodies_.set_periods(
      Vec3(domain->xperiodic ? domain->xprd : 0, domain->yperiodic ? domain->yprd : 0, domain->zperiodic ? domain->zprd : 0));
  new_run_ = true;
}

double FixSolidCull::max_rad(int type) {
  return type >= 0 && type < static_cast<int>(largest_radius_by_type_.size()) ? largest_radius_by_type_[type] : 0.0;
}

// the engine makes the tables of its contact models for the types that it sees among its atoms and that fixes name: a run may
// start with all granules of a type in the store
int FixSolidCull::min_type() {
  for (std::size_t type = 1; type < largest_radius_by_type_.size(); ++type)
    if (largest_radius_by_type_[type] > 0) return static_cast<int>(type);
  return 0;
}

int FixSolidCull::max_type() {
  for (std::size_t type = largest_radius_by_type_.size(); type-- > 1;)
    if (largest_radius_by_type_[type] > 0) return static_cast<int>(type);
  return 0;
}

void FixSolidCull::setup_pre_exchange() {
  find_scales();
  if (!store_) {
    new_run_ = false;
    return;
  }
  // a restart file keeps groups: marks of granules that this fix does not hold would hide their contacts
  const int bit = group->bitmask[interface_group_];
  for (int i = 0; i < atom->nlocal; ++i)
    if (!shell_[i].locked) atom->mask[i] &= ~bit;
  if (!restart_state_.empty()) guarded([&] { take_up_restart_state(); });
  open_for_insertion();
  guarded([&] { change_membership(); });
  new_run_ = false;
}

void FixSolidCull::setup(int) {
  // fixes after this one add their forces later: the loads are taken at the start of the first step
  after_setup_ = true;
}

void FixSolidCull::pre_initial_integrate() {
  if (!after_setup_) return;
  after_setup_ = false;
  if (!store_) return;
  take_loads();
  const Vec3 g = gravity();
  if (g != gravity_then_) watch_effective_gravity(true);
  gravity_then_ = g;
  see_walls(true);
  if (any_rank(!waking_.empty() || !waking_bodies_.empty())) ask_for_build(update->ntimestep);
  next_look_ = ((update->ntimestep - 1) / look_every_ + 1) * look_every_;
  if (locked_everywhere_ == 0 && !settings_.every) {
    quick_looks_ = settings_.calm;
    if (last_look_ >= update->ntimestep) last_look_ = INT32_MIN;  // time was set back
    next_look_ = std::max(update->ntimestep, last_look_ + quick_interval());
  }
  no_cull_until_ = -1;
  worth_ = WorthWatch();
  told_no_worth_ = false;
}

// ------------------------------------------------------------------------------------------------------------ the time step

void FixSolidCull::pre_exchange() {
  if (!store_) return;
  if (any_rank(halo_.subdomain_changed())) {
    halo_.update();
    at_home_.clear();
  }
  guarded([&] { change_membership(); });
}

void FixSolidCull::pre_neighbor() {
  locked_index_stale_ = true;
  lists_are_new_ = true;
  if (!store_) return;
  take_over_atoms();
  forget_lost_atoms();
  share_bodies();
  check_inserted();
  if (checking()) check_invariants();
}

void FixSolidCull::check_invariants() {
  // I1: ghosts are here, so every exterior granule near this rank's interior ones is seen
  const int bit = group->bitmask[interface_group_];
  for (int i = 0; i < atom->nlocal + atom->nghost; ++i) {
    if (atom->mask[i] & bit) continue;
    for_each_stored_near(sphere(i), 0.0, [&](const Resident& g) {
      broken("exterior granule " + std::to_string(atom->tag[i]) + " touches interior granule " + std::to_string(g.tag));
    });
  }
  for (int i = 0; i < atom->nlocal; ++i)
    if (shell_[i].locked && store_bodies_ > 1)
      for_each_stored_near(
          sphere(i), 0.0,
          [&](const Resident& g) {
            broken("granule " + std::to_string(atom->tag[i]) + " of another body touches interior granule " +
                   std::to_string(g.tag));
          },
          key_of(shell_[i].body));
  // I2: the ledger
  if (ledger_.count_due() != static_cast<std::int64_t>(store_->size()))
    broken("the ledger has " + std::to_string(ledger_.count_due()) + " granules in the store, which holds " +
           std::to_string(store_->size()));
  const double mass = store_->mass_recounted();
  if (std::abs(ledger_.mass_error(*store_)) > 1e-12 * mass || std::abs(store_->mass() - mass) > 1e-12 * mass)
    broken("mass in the store differs from the ledger");
  // every locked granule is a member of a body, and nothing else is
  std::size_t locked = store_->size();
  for (int i = 0; i < atom->nlocal; ++i) locked += shell_[i].locked;
  if (locked != locked_here())
    broken(std::to_string(locked_here()) + " granules are in bodies and " + std::to_string(locked) + " are locked");
  // and each body has the count, mass and first moment of its granules
  std::map<int, MassProperties> sums;
  for (int i = 0; i < atom->nlocal; ++i) {
    const ShellEntry& e = shell_[i];
    if (!e.locked) continue;
    if (e.body != bodies_.body_of(atom->tag[i]))
      broken("interface granule " + std::to_string(atom->tag[i]) + " stands in the wrong body");
    sums[e.body].add(atom->rmass[i], e.place, atom->radius[i], +1, e.held);
  }
  store_->for_each([&](const Resident& r) {
    const StoredGranule g = store_->get(r.tag);
    if (g.body != bodies_.body_of(g.tag)) broken("interior granule " + std::to_string(g.tag) + " lies in the wrong body");
    if (store_->frame_of(g.body) == GranuleStore::shared_frame &&
        !(bodies_.body(g.body).grounded && bodies_.pose(g.body) == Pose()))
      broken("body " + std::to_string(g.body) + " moves and lies among those that stand still");
    sums[g.body].add(g.mass, g.position, g.radius, +1, g.held);
  });
  for (const auto& [number, sum] : sums) {
    const MassProperties& m = bodies_.body(number).mass;
    // both are sums of so many numbers, in another order
    const double rounding = std::max(1e-12, std::numeric_limits<double>::epsilon() * static_cast<double>(sum.count));
    if (m.count != sum.count || m.held != sum.held || std::abs(m.mass - sum.mass) > rounding * sum.mass ||
        (m.centre() - sum.centre()).norm() > 1e-9 * domain->prd[0] + (compact() ? 1e-7 * diameter_ : 0.0))
      broken("body " + std::to_string(number) + " has other mass properties than its granules: count " +
             std::to_string(m.count - sum.count) + ", held " + std::to_string(m.held - sum.held) + ", mass by " +
             std::to_string((m.mass - sum.mass) / sum.mass * 1e12) + "e-12 of it, centre by " +
             std::to_string((m.centre() - sum.centre()).norm() / diameter_ * 1e9) + "e-9 d");
  }
}

void FixSolidCull::setup_pre_force(int) {
  lists_are_new_ = true;
  pre_force(0);
}

void FixSolidCull::pre_force(int) {
  mesh_loads_.begin_step();
  if (!lists_are_new_) return;
  lists_are_new_ = false;
  leave_locked_pairs_out();
}

void FixSolidCull::leave_locked_pairs_out() {
  // `neigh_modify exclude` would do it, at a test for every candidate pair: neighbour builds take 1.7 times as long with it
  const auto timed = watch_.time(Part::load);
  std::vector<int> body(static_cast<std::size_t>(atom->nlocal + atom->nghost));
  for (int i = 0; i < atom->nlocal + atom->nghost; ++i) body[i] = key_of_atom(i);
  LAMMPS_NS::NeighList* list = force->pair->list;
  LAMMPS_NS::NeighList* histories = force->pair->listgranhistory;
  const int width = static_cast<LAMMPS_NS::PairGran*>(force->pair)->dnum();
  for (int row = 0; row < list->inum; ++row) {
    const int i = list->ilist[row];
    if (i >= atom->nlocal || !body[i]) continue;
    int kept = 0;
    for (int k = 0; k < list->numneigh[i]; ++k) {
      if (body[list->firstneigh[i][k] & NEIGHMASK] == body[i]) continue;
      list->firstneigh[i][kept] = list->firstneigh[i][k];
      if (histories) {
        histories->firstneigh[i][kept] = histories->firstneigh[i][k];
        std::copy_n(histories->firstdouble[i] + static_cast<std::ptrdiff_t>(width) * k, width,
                    histories->firstdouble[i] + static_cast<std::ptrdiff_t>(width) * kept);
      }
      ++kept;
    }
    list->numneigh[i] = kept;
  }
}

void FixSolidCull::rebase_thawed_contacts() {
  // a contact that came out of the body brings the load that it had inside: no change for the granule that stays (invariant I5)
  thawed_ = false;
  const int owned = atom->nlocal;
  const LAMMPS_NS::NeighList* list = force->pair->list;
  for (int row = 0; row < list->inum; ++row) {
    const int i = list->ilist[row];
    if (i >= owned) continue;
    const bool freed = freed_anywhere_.contains(atom->tag[i]);
    const bool stays = shell_[i].locked && !shell_[i].fresh;
    if (!freed && !stays) continue;
    for (int k = 0; k < list->numneigh[i]; ++k) {
      const int j = list->firstneigh[i][k] & NEIGHMASK;
      const bool other_freed = freed_anywhere_.contains(atom->tag[j]);
      const bool other_stays = j < owned && shell_[j].locked && !shell_[j].fresh;
      if (!(stays && other_freed) && !(freed && other_stays)) continue;
      const double reach = (atom->radius[i] + atom->radius[j]) * neighbor->contactDistanceFactor;
      if ((vec(atom->x[i]) - vec(atom->x[j])).squaredNorm() > reach * reach) continue;
      const Vec3 f = pair_force_.on_first(i, k);
      if (stays && other_freed) shell_[i].reference += bodies_.pose(shell_[i].body).turned_to_frame(f);
      if (freed && other_stays) shell_[j].reference -= bodies_.pose(shell_[j].body).turned_to_frame(f);
    }
  }
}

void FixSolidCull::ask_for_reneighbouring_if_waking() {
  // gentle loads wait for each other; a blow does not: what it strikes would stand like a rock until then
  if (locked_everywhere_ == 0) return;
  // looks are among these steps: one rebuild of the neighbour lists does for what wakes and what is culled
  const auto fits = [](double in, double of) { return std::max(1, static_cast<int>(std::lround(in / of))); };
  const int cycle = look_every_ * fits(wake_together, look_every_), times = fits(cycle, wake_together);
  const int period = (cycle + times - 1) / times;
  const bool time = update->ntimestep % cycle % period == 0;
  if (comm->nprocs == 1 ? !(time || largest_excess_ > blow) : !(time || any_rank(largest_excess_ > blow))) return;
  bool waking = false;
  for (const int i : locked_index_) {
    ShellEntry& e = shell_[i];
    if (e.excess > 1) {
      waking_.push_back({vec(atom->x[i]), wake_up_.radius(e.excess)});
      waking = true;
    }
    e.excess = 0;
  }
  int asked[2] = {waking || (rigid() && body_comes_too_far(period + 1)), rigid() && body_is_fast(period + 1)};
  if (comm->nprocs > 1) MPI_Allreduce(MPI_IN_PLACE, asked, 2, MPI_INT, MPI_MAX, world);
  if (asked[0]) ask_for_build(update->ntimestep + 1);
  fast_bodies_ = asked[1];
}

void FixSolidCull::pre_final_integrate() {
  if (!store_) {  // the run started with an empty box: the first granules that are poured set the scales
    if (update->ntimestep % first_granules_every == 0) find_scales();
    if (!store_) return;
    next_look_ = update->ntimestep + look_every_;
  }
  take_loads();
  ask_for_reneighbouring_if_waking();
  if (update->ntimestep == next_look_) {
    look();
    if (any_rank(!waking_.empty() || !waking_bodies_.empty())) ask_for_build(update->ntimestep + 1);
  }
  if (stored_everywhere_ > 0) open_for_insertion();
}

void FixSolidCull::end_of_step() {
  if (!store_) return;
  const auto due = [&](int every) { return every > 0 && update->ntimestep % every == 0; };
  for (const Output& o : settings_.meshes)
    if (due(o.every)) write_mesh_file(o.file);
  for (const Output& o : settings_.beds)
    if (due(o.every)) write_bed_file(o.file);
}

// ------------------------------------------------------------------------------------------------------------ numbers

double FixSolidCull::compute_scalar() { return compute_vector(2); }

double FixSolidCull::compute_vector(int n) {
  if (n < 0 || n >= size_vector) return 0;
  if (totals_step_ != update->ntimestep || totals_version_ != membership_version_) {
    totals_.clear();
    carried_.clear();
  }
  totals_step_ = update->ntimestep;
  totals_version_ = membership_version_;
  if (totals_.empty()) count_totals();
  if (n < counts) return totals_[n];
  if (carried_.empty()) sum_carried();
  return carried_[n - counts];
}

void FixSolidCull::count_totals() {
  double bodies = 0, interface = 0;
  for (const auto& b : bodies_.bodies()) bodies += key_of(b.first) == b.first * comm->nprocs + comm->me;
  for (int i = 0; i < atom->nlocal; ++i) interface += shell_[i].locked;
  double sums[9] = {atom->nlocal - interface,
                    interface,
                    store_ ? static_cast<double>(store_->size()) : 0.0,
                    bodies,
                    store_ ? store_->mass() : 0.0,
                    static_cast<double>(ledger_.granules_locked()),
                    static_cast<double>(ledger_.granules_restored()),
                    store_ ? ledger_.mass_error(*store_) : 0.0,
                    ledger_.energy_added()};
  MPI_Allreduce(MPI_IN_PLACE, sums, 9, MPI_DOUBLE, MPI_SUM, world);
  double largest[2] = {largest_excess_, watch_.total()};
  MPI_Allreduce(MPI_IN_PLACE, largest, 2, MPI_DOUBLE, MPI_MAX, world);
  totals_ = {sums[0],    sums[1],    sums[2], sums[3], sums[4], sums[5], sums[6], static_cast<double>(ledger_.carves()),
             largest[0], largest[1], sums[7], sums[8]};
}

void FixSolidCull::sum_carried() {
  // what interior granules carry, so that a deck can add it to what its atoms have: momentum, angular momentum about the origin,
  // kinetic energy, and their centre of mass
  double mass = 0;
  Vec3 momentum = Vec3::Zero(), turning = Vec3::Zero(), moment = Vec3::Zero();
  double energy = 0;
  if (store_)
    store_->for_each([&](const Resident& g) {
      const Twist& twist = bodies_.body(g.body).twist;
      const Vec3 x = in_world(g);
      const double m = store_->get(g.tag).mass;
      const RigidPart p = RigidPart::granule(m, g.radius, x, twist.at(x), twist.spin);
      mass += m;
      momentum += m * p.velocity;
      turning += p.angular_momentum(Vec3::Zero());
      energy += p.kinetic_energy();
      moment += m * x;
    });
  carried_ = {momentum[0], momentum[1], momentum[2], turning[0], turning[1], turning[2],
              energy,      moment[0],   moment[1],   moment[2],  mass};
  MPI_Allreduce(MPI_IN_PLACE, carried_.data(), static_cast<int>(carried_.size()), MPI_DOUBLE, MPI_SUM, world);
  for (int d = 7; d < 10; ++d) carried_[d] = carried_[10] > 0 ? carried_[d] / carried_[10] : 0.0;
}

double FixSolidCull::memory_usage() {
  double bytes = static_cast<double>(shell_.capacity() * sizeof(ShellEntry) + contacts_.memory_bytes() + bodies_.member_bytes());
  if (store_) bytes += static_cast<double>(store_->memory_bytes());
  return bytes;
}

void FixSolidCull::post_run() {
  if (!store_) return;
  static const char* names[] = {"load", "look", "depth", "membership", "shell", "mesh", "files"};
  double seconds[static_cast<int>(Part::count)];
  for (int p = 0; p < static_cast<int>(Part::count); ++p) seconds[p] = watch_.seconds(static_cast<Part>(p));
  MPI_Allreduce(MPI_IN_PLACE, seconds, static_cast<int>(Part::count), MPI_DOUBLE, MPI_MAX, world);
  totals_.clear();
  compute_vector(0);
  char text[512];
  std::snprintf(
      text, sizeof text,
      "fix %s solid/cull: %.0f exterior, %.0f interface, %.0f interior granules in %.0f bodies; culled %.0f, restored %.0f, "
      "carves %.0f; mass error %.3g kg, energy added %.3g J",
      id, totals_[0], totals_[1], totals_[2], totals_[3], totals_[5], totals_[6], totals_[7], totals_[10], totals_[11]);
  say(text);
  double total = 0;
  std::string parts;
  for (int p = 0; p < static_cast<int>(Part::count); ++p) {
    total += seconds[p];
    std::snprintf(text, sizeof text, "%s%s %.3g", p ? ", " : "", names[p], seconds[p]);
    parts += text;
  }
  std::snprintf(text, sizeof text, "fix %s solid/cull: %.4g s in the fix since it was made: %s", id, total, parts.c_str());
  say(text);
}

// ------------------------------------------------------------------------------------------------------------ per atom

void FixSolidCull::grow_arrays(int nmax) {
  shell_.resize(nmax);
  memory->grow(vector_atom, nmax, "solid_cull:body");
}

void FixSolidCull::copy_arrays(int from, int to, int) {
  shell_[to] = shell_[from];
  vector_atom[to] = vector_atom[from];
}

void FixSolidCull::set_arrays(int i) {
  shell_[i] = ShellEntry();
  vector_atom[i] = 0;
}

int FixSolidCull::pack_exchange(int i, double* buffer) {
  (shell_[i].locked && shell_[i].body > 0 ? shell_[i].in_world(bodies_.pose(shell_[i].body)) : shell_[i]).pack(buffer);
  buffer[ShellEntry::packed_size] = vector_atom[i];
  return ShellEntry::packed_size + 1;
}

int FixSolidCull::unpack_exchange(int i, double* buffer) {
  shell_[i] = ShellEntry::unpack(buffer);
  shell_[i].body = -1;  // to be taken over: see take_over_atoms
  vector_atom[i] = buffer[ShellEntry::packed_size];
  return ShellEntry::packed_size + 1;
}

}  // namespace solidcull
