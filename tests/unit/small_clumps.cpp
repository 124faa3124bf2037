#include "small_clumps.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <stdexcept>
#include <string>

#include "clump_numbers.h"
#include "small_world.h"

namespace solidcull {
namespace {

/// What all ranks have, in one list, by rank.
template <class Row>
std::vector<Row> all_rows(const SmallRanks& ranks, const std::string& what, const std::vector<Row>& mine) {
  std::vector<Row> all;
  for (const auto& bytes : ranks.all(what, mine.data(), mine.size() * sizeof(Row))) {
    const std::size_t n = all.size();
    all.resize(n + bytes.size() / sizeof(Row));
    if (!bytes.empty()) std::memcpy(&all[n], bytes.data(), bytes.size());
  }
  return all;
}

Eigen::Quaterniond turned_by(const Vec3& angle) {
  return angle.isZero(0) ? Eigen::Quaterniond::Identity()
                         : Eigen::Quaterniond(Eigen::AngleAxisd(angle.norm(), angle.normalized()));
}

Vec3 spin_at(const Clump& c, const Eigen::Quaterniond& turn) {
  return turn * (turn.conjugate() * c.angular_momentum).cwiseQuotient(c.lies.inertia);
}

/// Mass, centre and inertia of spheres that turn as one; where they overlap mass counts twice.
void weigh(const std::vector<Sphere>& spheres, const std::vector<double>& masses, Clump& c) {
  Vec3 first = Vec3::Zero();
  for (std::size_t k = 0; k < spheres.size(); ++k) {
    c.mass += masses[k];
    first += masses[k] * spheres[k].centre;
  }
  c.lies.centre = first / c.mass;
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  for (std::size_t k = 0; k < spheres.size(); ++k) {
    const Vec3 arm = spheres[k].centre - c.lies.centre;
    const double own = 0.4 * spheres[k].radius * spheres[k].radius;
    inertia += masses[k] * ((own + arm.squaredNorm()) * Eigen::Matrix3d::Identity() - arm * arm.transpose());
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(inertia);
  Eigen::Matrix3d turn = axes.eigenvectors();
  if (turn.determinant() < 0) turn.col(0) *= -1;
  c.lies.turn = Eigen::Quaterniond(turn);
  c.lies.inertia = axes.eigenvalues();
}

}  // namespace

SmallClumps::SmallClumps(SmallWorld& world) : world_(world) {
  possible = world.deck.clumps;
  of_atom = &world.atoms.clump;
  rest_size = rest_numbers;
}

int SmallClumps::find(int number) const {
  const auto row = std::find_if(rows_.begin(), rows_.end(), [&](const Clump& c) { return c.number == number; });
  return row == rows_.end() ? -1 : static_cast<int>(row - rows_.begin());
}

double SmallClumps::largest() const {
  for (const Clump& c : rows_) largest_ = std::max(largest_, c.rest[apart]);
  return largest_;
}

void SmallClumps::know_largest(double apart) { largest_ = std::max(largest_, apart); }

Clump SmallClumps::take(int number) {
  const int k = find(number);
  if (k < 0) throw std::logic_error("clump " + std::to_string(number) + " is not on this rank");
  largest();
  const Clump c = rows_[static_cast<std::size_t>(k)];
  rows_[static_cast<std::size_t>(k)] = rows_.back();
  rows_.pop_back();
  return c;
}

void SmallClumps::put(const Clump& clump, int sphere) {
  if (find(clump.number) >= 0) throw std::logic_error("clump " + std::to_string(clump.number) + " is moved already");
  Clump c = clump;
  const Vec3 there = world_.atoms.place(sphere) - c.lies.turn * world_.atoms.arm(sphere);
  c.lies.centre += world_.image_shift(there - c.lies.centre);
  read(c);
}

void SmallClumps::set_clump(int i, int number) { world_.atoms.clump[i] = number; }

void SmallClumps::read(const Clump& clump) {
  if (clump.rest.size() != rest_numbers) throw std::logic_error("a clump has lost numbers of the engine's");
  keep_number(clump.number);
  rows_.push_back(clump);
}

void SmallClumps::throw_all(const Vec3& velocity) {
  for (Clump& c : rows_) c.move_as(velocity, Vec3::Zero());
}

int SmallClumps::make(int first_tag, const std::vector<Sphere>& spheres, const Vec3& velocity, const Vec3& spin) {
  std::int64_t highest = highest_;
  world_.ranks.largest(&highest, 1);
  Clump c;
  c.number = static_cast<int>(highest) + 1;
  c.spheres = static_cast<int>(spheres.size());
  std::vector<double> masses;
  double far = 0;
  for (const Sphere& s : spheres) {
    masses.push_back(world_.mass_of(s.radius));
    for (const Sphere& other : spheres) far = std::max(far, (s.centre - other.centre).norm());
  }
  weigh(spheres, masses, c);
  c.move_as(velocity, spin);
  c.rest = {0.1 * c.number, far};
  keep_number(c.number);
  for (std::size_t k = 0; k < spheres.size(); ++k) {
    const Vec3 arm = c.lies.turn.conjugate() * (spheres[k].centre - c.lies.centre), turned = c.lies.turn * arm;
    const int i = world_.add(first_tag + static_cast<int>(k), c.lies.centre + turned, spheres[k].radius,
                             velocity + spin.cross(turned), spin);
    if (i < 0) continue;
    world_.atoms.set_size(i, spheres[k].radius, c.mass);
    world_.atoms.set_clump(i, c.number, arm);
  }
  if (world_.ranks.owns(c.lies.centre)) rows_.push_back(c);
  return c.number;
}

// ------------------------------------------------------------------------------------------------------------ motion

void SmallClumps::take_loads() {
  loads_.clear();
  if (!possible) return;
  struct OfSphere {
    int number, tag;
    Triple arm, force, torque;
  };
  const SmallAtoms& atoms = world_.atoms;
  std::vector<OfSphere> mine;
  for (int i = 0; i < atoms.owned; ++i)
    if (of(i))
      mine.push_back(
          {of(i), atoms.tag[i], triple(atoms.arm(i)), triple(atoms.force(i)), triple(vec(atoms.torque + 3 * std::size_t(i)))});
  std::vector<OfSphere> all = all_rows(world_.ranks, "the engine's loads on clumps", mine);
  std::sort(all.begin(), all.end(), [](const OfSphere& a, const OfSphere& b) { return a.tag < b.tag; });
  for (const OfSphere& s : all) {
    const int k = find(s.number);
    if (k < 0) continue;
    Load& load = loads_[s.number];
    load.force += vec(s.force);
    load.torque += vec(s.torque) + (rows_[static_cast<std::size_t>(k)].lies.turn * vec(s.arm)).cross(vec(s.force));
  }
}

void SmallClumps::kick() {
  const double half = 0.5 * world_.run.dt;
  for (Clump& c : rows_) {
    const Load& load = loads_[c.number];
    c.velocity += half * (load.force / c.mass + world_.deck.gravity);
    c.angular_momentum += half * load.torque;
  }
}

/// It turns by the spin that it has in the middle of the step.
void SmallClumps::drift() {
  const double dt = world_.run.dt;
  for (Clump& c : rows_) {
    const Eigen::Quaterniond middle = turned_by(0.5 * dt * c.spin()) * c.lies.turn;
    c.lies.centre += dt * c.velocity;
    c.lies.turn = (turned_by(dt * spin_at(c, middle)) * c.lies.turn).normalized();
  }
  move_spheres(true);
}

void SmallClumps::give_velocities() { move_spheres(false); }

/// A clump as the ranks need it that have spheres of it.
struct SmallClumps::Motion {
  int number;
  Triple centre, velocity, spin;
  std::array<double, 4> turn;
};

std::map<int, SmallClumps::Motion> SmallClumps::motions() const {
  std::vector<Motion> mine;
  for (const Clump& c : rows_) {
    const auto& q = c.lies.turn;
    mine.push_back({c.number, triple(c.lies.centre), triple(c.velocity), triple(c.spin()), {q.w(), q.x(), q.y(), q.z()}});
  }
  std::map<int, Motion> all;
  for (const Motion& m : all_rows(world_.ranks, "the engine's clumps", mine))
    if (!all.emplace(m.number, m).second) throw std::logic_error("two ranks move clump " + std::to_string(m.number));
  return all;
}

void SmallClumps::move_spheres(bool places_too) {
  if (!possible) return;
  const std::map<int, Motion> all = motions();
  SmallAtoms& atoms = world_.atoms;
  for (int i = 0; i < atoms.owned; ++i) {
    if (!of(i)) continue;
    const auto m = all.find(of(i));
    if (m == all.end()) throw std::logic_error("no rank moves clump " + std::to_string(of(i)));
    const auto& q = m->second.turn;
    const Vec3 arm = Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * atoms.arm(i), spin = vec(m->second.spin);
    if (places_too) {
      const Vec3 x = vec(m->second.centre) + arm;
      atoms.set_place(i, x + world_.image_shift(atoms.place(i) - x));
    }
    atoms.set_velocity(i, vec(m->second.velocity) + spin.cross(arm));
    atoms.set_spin(i, spin);
  }
}

// ------------------------------------------------------------------------------------------------------------ between ranks

void SmallClumps::exchange() {
  if (!possible) return;
  std::vector<double> out;
  std::vector<Clump> stay;
  for (Clump& c : rows_) {
    c.lies.centre = world_.run.wrapped(c.lies.centre);
    if (world_.ranks.owns(c.lies.centre))
      stay.push_back(c);
    else
      pack(c, out);
  }
  rows_ = std::move(stay);
  const std::vector<double> all = all_rows(world_.ranks, "the engine's exchange of clumps", out);
  for (std::size_t at = 0; at < all.size(); at += clump_numbers + rest_numbers) {
    const Clump c = unpack_clump(&all[at], rest_numbers);
    if (world_.ranks.owns(c.lies.centre)) read(c);
  }
  delete_broken();
}

void SmallClumps::delete_broken() {
  struct Spheres {
    int number, there;
  };
  SmallAtoms& atoms = world_.atoms;
  std::vector<Spheres> mine;
  for (const Clump& c : rows_) mine.push_back({c.number, -c.spheres});
  for (int i = 0; i < atoms.owned; ++i)
    if (of(i)) mine.push_back({of(i), 1});
  std::map<int, int> too_many;
  for (const Spheres& s : all_rows(world_.ranks, "the engine's count of spheres", mine)) too_many[s.number] += s.there;
  for (int i = atoms.owned - 1; i >= 0; --i)
    if (of(i) && too_many.at(of(i)) != 0) atoms.take_out(i);
  for (const auto& [number, n] : too_many)
    if (n != 0 && find(number) >= 0) take(number);
}

}  // namespace solidcull
