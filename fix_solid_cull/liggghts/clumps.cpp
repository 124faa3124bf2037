#include "clumps.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>

#include "atom.h"
#include "domain.h"
#include "engine_access.h"
#include "fix_multisphere.h"
#include "internal_error.h"
#include "math_extra.h"
#include "memory.h"
#include "modify.h"

namespace solidcull {
namespace {

constexpr int no_row = -1, no_clump = -1;
constexpr bool dummy = false;

}  // namespace

LAMMPS_NS::Multisphere& EngineClumps::all() const { return fix_->data(); }

void EngineClumps::connect() {
  fix_ = nullptr;
  for (int f = 0; f < modify->nfix && !fix_; ++f) fix_ = dynamic_cast<LAMMPS_NS::FixMultisphere*>(modify->fix[f]);
  possible = fix_ != nullptr;
  of_atom = possible ? &engine::clumps_of_atoms(*fix_) : nullptr;
  if (possible) find_columns();
}

/// Calls visit(column, its place in a packed row, its numbers). They follow each other in the order in which they were made; some
/// do not go to other ranks, and are not packed.
template <class Visit>
void EngineClumps::for_each_column(Visit visit) const {
  int place = 0;
  for (int c = 0; LAMMPS_NS::ContainerBase* column = all().prop().getElementPropertyBase(c); ++c) {
    const int size = column->elemBufSize(LAMMPS_NS::OPERATION_COMM_EXCHANGE, dummy, dummy, dummy);
    if (size == 0) continue;
    visit(*column, place, size);
    place += size;
  }
}

void EngineClumps::find_columns() {
  const struct {
    const char* name;
    int* place;
  } wanted[] = {{"id_multisphere", &at_.number},   {"xcm", &at_.centre},       {"vcm", &at_.velocity},
                {"angmom", &at_.angular_momentum}, {"omega", &at_.spin},       {"quat", &at_.quaternion},
                {"masstotal", &at_.mass},          {"inertia", &at_.inertia},  {"ex_space", &at_.axes[0]},
                {"ey_space", &at_.axes[1]},        {"ez_space", &at_.axes[2]}, {"nrigid", &at_.spheres}};
  for (const auto& w : wanted) *w.place = -1;
  rest_size = 0;
  for_each_column([&](LAMMPS_NS::ContainerBase& column, int place, int size) {
    for (const auto& w : wanted)
      if (std::strcmp(column.id(), w.name) == 0) *w.place = place;
    rest_size = place + size;
  });
  for (const auto& w : wanted)
    if (*w.place < 0) throw InternalError(std::string("clumps of this LIGGGHTS have no column ") + w.name);
}

int EngineClumps::count() const { return possible ? all().n_body() : 0; }

int EngineClumps::find(int number) const {
  const int* const rows = possible ? engine::rows_of_clumps(all()) : nullptr;
  if (!rows || number > engine::highest_clump(all())) return no_row;
  return rows[number];
}

Vec3 EngineClumps::centre(int k) const {
  double x[3];
  all().x_bound(x, k);
  return vec(x);
}

double EngineClumps::largest() const {
  for (int k = 0; k < count(); ++k) largest_ = std::max(largest_, 2 * all().r_bound(k));
  return largest_;
}

int EngineClumps::highest_number() const { return possible ? engine::highest_clump(all()) : 0; }

/// The engine counts them itself at the next neighbour build; a restart file may be written before.
void EngineClumps::publish_count(std::int64_t everywhere) { engine::clumps_everywhere(all()) = static_cast<int>(everywhere); }

Clump EngineClumps::clump(int k) const {
  Clump c;
  c.rest.resize(static_cast<std::size_t>(rest_size));
  all().prop().pushElemToBuffer(k, c.rest.data(), LAMMPS_NS::OPERATION_COMM_EXCHANGE, dummy, dummy, dummy);
  double* const row = c.rest.data();
  c.number = static_cast<int>(row[at_.number]);
  c.spheres = static_cast<int>(row[at_.spheres]);
  c.mass = row[at_.mass];
  c.lies.centre = vec(row + at_.centre);
  const double* const q = row + at_.quaternion;
  c.lies.turn = Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
  c.lies.inertia = vec(row + at_.inertia);
  c.velocity = vec(row + at_.velocity);
  c.angular_momentum = vec(row + at_.angular_momentum);
  // what stands above, or follows from it, is told once
  for (const int of_three : {at_.centre, at_.velocity, at_.angular_momentum, at_.spin, at_.axes[0], at_.axes[1], at_.axes[2]})
    std::fill_n(row + of_three, 3, 0.0);
  std::fill_n(row + at_.quaternion, 4, 0.0);
  row[at_.number] = 0;
  return c;
}

Clump EngineClumps::take(int number) {
  const int k = find(number);
  if (k < 0) throw InternalError("clump " + std::to_string(number) + " is not on this rank");
  const Clump c = clump(k);
  remove(k, number);
  return c;
}

void EngineClumps::remove(int k, int number) {
  largest_ = std::max(largest_, 2 * all().r_bound(k));
  all().remove_body(k);
  engine::rows_of_clumps(all())[number] = no_row;  // remove_body() names it still where it was the last
}

int EngineClumps::add(double* row, int number) {
  LAMMPS_NS::Multisphere& clumps = all();
  clumps.prop().popElemFromBuffer(row, LAMMPS_NS::OPERATION_COMM_EXCHANGE, dummy, dummy, dummy);
  const int here = engine::clumps_here(clumps)++;
  engine::rows_of_clumps(clumps)[number] = here;
  return here;
}

void EngineClumps::send_far(const Ranks& ranks) {
  std::map<int, std::vector<double>> to;
  numbers_.resize(static_cast<std::size_t>(rest_size));
  for (int k = count() - 1; k >= 0; --k) {
    const Vec3 at = centre(k);
    if (ranks.brings_home(at)) continue;
    all().prop().pushElemToBuffer(k, numbers_.data(), LAMMPS_NS::OPERATION_COMM_EXCHANGE, dummy, dummy, dummy);
    std::vector<double>& rows = to[ranks.owner(at)];
    rows.insert(rows.end(), numbers_.begin(), numbers_.end());
    remove(k, static_cast<int>(numbers_[static_cast<std::size_t>(at_.number)]));
  }
  for (auto& [rank, rows] : ranks.deliver(to))
    for (std::size_t at = 0; at < rows.size(); at += static_cast<std::size_t>(rest_size)) {
      const int number = static_cast<int>(rows[at + static_cast<std::size_t>(at_.number)]);
      keep_number(number);
      add(&rows[at], number);
    }
}

/// Its centre is where its spheres say, in the periodic image that their image flags name. A fix that came while it was culled
/// may have given clumps a column more.
void EngineClumps::put(const Clump& c, int sphere) {
  keep_number(c.number);
  numbers_ = c.rest;
  numbers_.resize(static_cast<std::size_t>(rest_size));
  double* const row = numbers_.data();
  row[at_.number] = c.number;
  double q[4] = {c.lies.turn.w(), c.lies.turn.x(), c.lies.turn.y(), c.lies.turn.z()};
  std::copy_n(q, 4, row + at_.quaternion);
  double axes[3][3];
  MathExtra::q_to_exyz(q, axes[0], axes[1], axes[2]);
  for (int a = 0; a < 3; ++a) std::copy_n(axes[a], 3, row + at_.axes[a]);
  double at[3];
  domain->unmap(atom->x[sphere], atom->image[sphere], at);
  const double* const displaced = engine::displacements(*fix_)[sphere];
  for (int d = 0; d < 3; ++d) {
    double centre = c.lies.centre[d];
    if (domain->periodicity[d]) {
      const double there = at[d] - (axes[0][d] * displaced[0] + axes[1][d] * displaced[1] + axes[2][d] * displaced[2]);
      centre += domain->prd[d] * std::round((there - centre) / domain->prd[d]);
    }
    row[at_.centre + d] = centre;
    row[at_.velocity + d] = c.velocity[d];
    row[at_.angular_momentum + d] = c.angular_momentum[d];
  }
  double turning[3], inertia[3];
  std::copy_n(row + at_.inertia, 3, inertia);
  std::copy_n(row + at_.angular_momentum, 3, turning);
  MathExtra::angmom_to_omega(turning, axes[0], axes[1], axes[2], inertia, row + at_.spin);
  const int here = add(row, c.number);
  if (static_cast<int>(c.rest.size()) >= rest_size) return;
  for_each_column([&](LAMMPS_NS::ContainerBase& column, int place, int) {
    if (place >= static_cast<int>(c.rest.size())) column.setToDefault(here);
  });
}

void EngineClumps::set_clump(int i, int number) { engine::clumps_of_atoms(*fix_)[i] = number > 0 ? number : no_clump; }

void EngineClumps::join_image(int i, int to) {
  double at[3];
  domain->unmap(atom->x[to], atom->image[to], at);
  LAMMPS_NS::tagint image[3];
  for (int d = 0; d < 3; ++d) {
    const double edges = domain->periodicity[d] ? std::round((at[d] - atom->x[i][d]) / domain->prd[d]) : 0;
    image[d] = static_cast<LAMMPS_NS::tagint>(edges) + IMGMAX;
  }
  atom->image[i] = image[2] << IMG2BITS | image[1] << IMGBITS | image[0];
}

/// The engine's table of rows by number is as long as the highest number that it knows.
void EngineClumps::keep_number(int number) {
  if (!possible) return;
  LAMMPS_NS::Multisphere& clumps = all();
  int& highest = engine::highest_clump(clumps);
  int*& rows = engine::rows_of_clumps(clumps);
  if (rows && number <= highest) return;
  const int before = rows ? highest + 1 : 0;
  highest = std::max(highest, number);
  memory->grow(rows, highest + 1, "Multisphere:mapArray_");
  std::fill(rows + before, rows + highest + 1, no_row);
}

}  // namespace solidcull
