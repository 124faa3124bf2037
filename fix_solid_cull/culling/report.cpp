#include "report.h"

#include <cstdio>
#include <string>

namespace solidcull {

double Report::value(int n) {
  if (n < 0 || n >= size) return 0;
  if (totals_step_ != bed_.run.step || totals_version_ != membership_version_) {
    totals_.clear();
    carried_.clear();
    all_.clear();
  }
  totals_step_ = bed_.run.step;
  totals_version_ = membership_version_;
  if (totals_.empty()) count_totals();
  if (n < counts) return totals_[n];
  if (n >= size - audited) return of_audits(n - (size - audited));
  if (n >= size - audited - gains) {
    const Forecast& f = forecast_;
    return std::array<double, gains>{meter_.times_less(), f.times_less, f.awake, f.moving}[n - (size - audited - gains)];
  }
  if (n >= counts + carried + of_all + again) return spent_[n - counts - carried - of_all - again];
  if (n >= counts + carried + of_all) return rests_again_[n - counts - carried - of_all];
  if (n < counts + carried) {
    if (carried_.empty()) sum_carried();
    return carried_[n - counts];
  }
  if (all_.empty()) sum_all();
  return all_[n - counts - carried];
}

double Report::of_audits(int n) const {
  if (n == 0) return static_cast<double>(audit_.tally().patches());
  const Interval i = audit_.tally().interval(static_cast<AuditTally::Figure>((n - 1) / 2));
  return n % 2 ? i.low : i.high;
}

void Report::count_totals() {
  double bodies = 0, interface_granules = 0;
  for (const auto& b : bed_.solid.bodies().bodies()) bodies += bed_.groups.has_key_of_first_part(b.first);
  if (bed_.solid.bodies().locked() > 0)
    for (int i = 0; i < bed_.atoms.owned; ++i) interface_granules += bed_.shell[i].locked;
  const Ledger& ledger = bed_.solid.ledger();
  const bool open = bed_.solid.has_store();
  const RunWork so_far = meter_.so_far();
  double sums[15] = {bed_.atoms.owned - interface_granules,
                     interface_granules,
                     open ? static_cast<double>(bed_.solid.store().size()) : 0.0,
                     bodies,
                     open ? bed_.solid.store().mass() : 0.0,
                     static_cast<double>(ledger.granules_locked()),
                     static_cast<double>(ledger.granules_restored()),
                     open ? ledger.mass_error(bed_.solid.store()) : 0.0,
                     ledger.energy_added(),
                     static_cast<double>(ledger.granules_locked_again()),
                     static_cast<double>(ledger.granules_that_moved()),
                     so_far.exterior,
                     so_far.interface,
                     so_far.interior,
                     static_cast<double>(ledger.carves())};
  bed_.ranks.sum(sums, 15);
  double largest[2] = {motion_.largest_excess(), watch_.total()};
  bed_.ranks.largest(largest, 2);
  totals_ = {sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6], sums[14], largest[0], largest[1], sums[7], sums[8]};
  rests_again_ = {sums[9], sums[10]};
  spent_ = {sums[11], sums[12], sums[13]};
}

namespace {

RigidPart of_clump(const ClumpMass& c, double mass, const Twist& twist) {
  return {mass, c.centre, c.tensor(), twist.at(c.centre), twist.spin};
}

}  // namespace

/// What interior granules carry, so that a deck can add it to what its atoms have: momentum, angular momentum about the origin,
/// kinetic energy, and their centre of mass.
void Report::sum_carried() {
  double mass = 0, energy = 0;
  Vec3 momentum = Vec3::Zero(), turning = Vec3::Zero(), moment = Vec3::Zero();
  if (bed_.solid.has_store())
    bed_.solid.store().for_each([&](const Resident& g) {
      const Twist& twist = bed_.solid.bodies().body(g.body).twist;
      const StoredGranule stored = bed_.solid.store().get(g.tag);
      const double m = stored.mass;
      Vec3 x = bed_.solid.in_world(g);
      RigidPart p = RigidPart::granule(m, g.radius, x, twist.at(x), twist.spin);
      if (stored.has_clump) {
        p = of_clump(stored.of_clump.in_world(bed_.solid.bodies().pose(g.body)), m, twist);
        x = p.centre;
      }
      mass += m;
      momentum += m * p.velocity;
      turning += p.angular_momentum(Vec3::Zero());
      energy += p.kinetic_energy();
      moment += m * x;
    });
  carried_ = {momentum[0], momentum[1], momentum[2], turning[0], turning[1], turning[2],
              energy,      moment[0],   moment[1],   moment[2],  mass};
  bed_.ranks.sum(carried_.data(), static_cast<int>(carried_.size()));
  for (int d = 7; d < 10; ++d) carried_[d] = carried_[10] > 0 ? carried_[d] / carried_[10] : 0.0;
}

/// Mass, centre of mass, and kinetic energy of the centres and of the spins, of all granules: places in the box, as atoms have
/// them.
void Report::sum_all() {
  double sums[6] = {};
  const auto add_part = [&](const RigidPart& p, const Vec3& x) {
    const double of_centre = 0.5 * p.mass * p.velocity.squaredNorm();
    sums[0] += p.mass;
    for (int d = 0; d < 3; ++d) sums[1 + d] += p.mass * x[d];
    sums[4] += of_centre;
    sums[5] += p.kinetic_energy() - of_centre;
  };
  const auto add = [&](double mass, double radius, const Vec3& x, const Vec3& v, const Vec3& spin) {
    add_part(RigidPart::granule(mass, radius, x, v, spin), x);
  };
  const auto add_clump = [&](const ClumpMass& in_frame, double mass, int body) {
    const RigidPart p = of_clump(in_frame.in_world(bed_.solid.bodies().pose(body)), mass, bed_.solid.bodies().body(body).twist);
    add_part(p, bed_.run.wrapped(p.centre));
  };
  const Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned; ++i)
    if (bed_.clump_spheres.of(i) == 0) add(atoms.mass[i], atoms.radius[i], atoms.place(i), atoms.velocity(i), atoms.spin(i));
  if (bed_.clumps.possible) {
    for (int k = 0; k < bed_.clumps.count(); ++k) {
      const Clump c = bed_.clumps.clump(k);
      add_part({c.mass, c.lies.centre, c.lies.tensor(), c.velocity, c.spin()}, bed_.run.wrapped(c.lies.centre));
    }
    for (int i = 0; i < atoms.owned; ++i)
      if (const Clump* c = bed_.shell[i].in_body() ? bed_.locked_clumps.find(atoms.tag[i]) : nullptr)
        add_clump(c->lies, c->mass, bed_.shell[i].body);
  }
  if (bed_.solid.has_store())
    bed_.solid.store().for_each([&](const Resident& g) {
      const StoredGranule stored = bed_.solid.store().get(g.tag);
      if (stored.has_clump) return add_clump(stored.of_clump, stored.mass, g.body);
      if (stored.clump) return;
      const Twist& twist = bed_.solid.bodies().body(g.body).twist;
      const Vec3 x = bed_.solid.in_world(g);
      add(stored.mass, g.radius, bed_.run.wrapped(x), twist.at(x), twist.spin);
    });
  bed_.ranks.sum(sums, 6);
  for (int d = 1; d < 4; ++d) sums[d] = sums[0] > 0 ? sums[d] / sums[0] : 0.0;
  all_.assign(sums, sums + 6);
}

void Report::tell_counters() {
  static const char* names[] = {"load", "look", "depth", "membership", "shell", "mesh", "files"};
  constexpr int parts = static_cast<int>(Part::count);
  double seconds[parts];
  for (int p = 0; p < parts; ++p) seconds[p] = watch_.seconds(static_cast<Part>(p));
  bed_.ranks.largest(seconds, parts);
  totals_.clear();
  value(0);
  char text[512];
  std::snprintf(text, sizeof text,
                "%.0f exterior, %.0f interface, %.0f interior granules in %.0f bodies; culled %.0f, restored %.0f, "
                "carves %.0f; mass error %.3g kg, energy added %.3g J; %.0f culled again, %.0f had moved",
                totals_[0], totals_[1], totals_[2], totals_[3], totals_[5], totals_[6], totals_[7], totals_[10], totals_[11],
                rests_again_[0], rests_again_[1]);
  bed_.run.say(text);
  double total = 0;
  std::string each;
  for (int p = 0; p < parts; ++p) {
    total += seconds[p];
    std::snprintf(text, sizeof text, "%s%s %.3g", p ? ", " : "", names[p], seconds[p]);
    each += text;
  }
  std::snprintf(text, sizeof text, "%.4g s in the fix since it was made: %s", total, each.c_str());
  bed_.run.say(text);
}

}  // namespace solidcull
