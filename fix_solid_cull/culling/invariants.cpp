#include "invariants.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>

namespace solidcull {
namespace {

[[noreturn]] void broken(const std::string& what) { throw InternalError(what); }

}  // namespace

bool Invariants::asked() {
#ifdef NDEBUG
  static const bool asked = std::getenv("SOLIDCULL_CHECK") != nullptr;
  return asked;
#else
  return true;
#endif
}

/// I1. Ghosts are here, so every exterior granule near this rank's interior ones is seen.
void Invariants::check_shell_is_closed() const {
  const Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned + atoms.ghosts; ++i) {
    if (atoms.is_interface(i)) continue;
    bed_.stored.for_each_near(atoms.sphere(i), 0.0, [&](const Resident& g) {
      broken("exterior granule " + std::to_string(atoms.tag[i]) + " touches interior granule " + std::to_string(g.tag));
    });
  }
  if (!bed_.census.several_bodies()) return;
  for (int i = 0; i < atoms.owned; ++i) {
    if (!bed_.shell[i].locked) continue;
    const BodyGroups::Key own = bed_.groups.key_of(bed_.shell[i].body);
    bed_.stored.for_each_near(
        atoms.sphere(i), 0.0,
        [&](const Resident& g) {
          broken("granule " + std::to_string(atoms.tag[i]) + " of another body touches interior granule " +
                 std::to_string(g.tag));
        },
        [&](int body) { return bed_.groups.key_of(body) == own; });
  }
}

/// I2.
void Invariants::check_ledger() const {
  const GranuleStore& store = bed_.solid.store();
  const Ledger& ledger = bed_.solid.ledger();
  if (ledger.count_due() != static_cast<std::int64_t>(store.size()))
    broken("the ledger has " + std::to_string(ledger.count_due()) + " granules in the store, which holds " +
           std::to_string(store.size()));
  const double mass = store.mass_recounted();
  if (std::abs(ledger.mass_error(store)) > 1e-12 * mass || std::abs(store.mass() - mass) > 1e-12 * mass)
    broken("mass in the store differs from the ledger");
}

/// Every locked granule is a member of a body, and nothing else is; each body has the count, mass and first moment of its
/// granules.
void Invariants::check_bodies() const {
  const Atoms& atoms = bed_.atoms;
  const GranuleStore& store = bed_.solid.store();
  const SolidBodies& bodies = bed_.solid.bodies();
  std::size_t locked = store.size();
  for (int i = 0; i < atoms.owned; ++i) locked += bed_.shell[i].locked;
  if (locked != bed_.solid.locked())
    broken(std::to_string(bed_.solid.locked()) + " granules are in bodies and " + std::to_string(locked) + " are locked");
  std::map<int, MassProperties> sums;
  for (int i = 0; i < atoms.owned; ++i) {
    const Locked& e = bed_.shell[i];
    if (!e.locked) continue;
    if (e.body != bodies.body_of(atoms.tag[i]))
      broken("interface granule " + std::to_string(atoms.tag[i]) + " stands in the wrong body");
    const GranuleMass g = bed_.masses.of_atom(i);
    sums[e.body].add(g, bodies.turning_radius(g.radius));
  }
  store.for_each([&](const Resident& r) {
    const StoredGranule g = store.get(r.tag);
    if (g.body != bodies.body_of(g.tag)) broken("interior granule " + std::to_string(g.tag) + " lies in the wrong body");
    if (store.frame_of(g.body) == GranuleStore::shared_frame && !(bodies.body(g.body).grounded && bodies.pose(g.body) == Pose()))
      broken("body " + std::to_string(g.body) + " moves and lies among those that stand still");
    sums[g.body].add({g.mass, g.position, g.radius, g.held, g.clump_mass()}, bodies.turning_radius(g.radius));
  });
  for (const auto& [number, sum] : sums) {
    const MassProperties& m = bodies.body(number).mass;
    // both are sums of so many numbers, in another order
    const double rounding = std::max(1e-12, std::numeric_limits<double>::epsilon() * static_cast<double>(sum.count));
    const double places = 1e-9 * bed_.run.edges()[0] + (bed_.scales.compact() ? 1e-7 * bed_.scales.diameter() : 0.0);
    const bool weighs = sum.weighing > 0;  // else the parts on other ranks do
    if (m.count != sum.count || m.weighing != sum.weighing || m.held != sum.held ||
        std::abs(m.mass - sum.mass) > rounding * sum.mass || (weighs && (m.centre() - sum.centre()).norm() > places))
      broken("body " + std::to_string(number) + " has other mass properties than its granules: count " +
             std::to_string(m.count - sum.count) + ", held " + std::to_string(m.held - sum.held) + ", mass by " +
             std::to_string((m.mass - sum.mass) / sum.mass * 1e12) + "e-12 of it, centre by " +
             std::to_string((m.centre() - sum.centre()).norm() / bed_.scales.diameter() * 1e9) + "e-9 d");
  }
}

/// A clump is stored whole, or all of its spheres are interface granules; one of them has its mass.
void Invariants::check_clumps() const {
  struct Seen {
    int stored = 0, interface_granules = 0, with_mass = 0, spheres = 0;
  };
  std::map<int, Seen> clumps;
  for (int i = 0; i < bed_.atoms.owned; ++i) {
    const Locked& e = bed_.shell[i];
    if (!e.locked || e.clump == 0 || e.spheres == Locked::some_lost) continue;
    Seen& c = clumps[e.clump];
    ++c.interface_granules;
    c.spheres = e.spheres;
    c.with_mass += bed_.locked_clumps.find(bed_.atoms.tag[i]) != nullptr;
    if (bed_.clumps.of(i)) broken("granule " + std::to_string(bed_.atoms.tag[i]) + " is locked and the engine moves its clump");
  }
  bed_.solid.store().for_each([&](const Resident& r) {
    const StoredGranule g = bed_.solid.store().get(r.tag);
    if (g.clump == 0) return;
    Seen& c = clumps[g.clump];
    ++c.stored;
    c.spheres = g.spheres;
    c.with_mass += g.has_clump;
  });
  for (const auto& [number, c] : clumps) {
    const bool whole = c.stored == c.spheres && c.interface_granules == 0 && c.with_mass == 1;
    const bool shell = c.stored == 0 && c.with_mass <= 1 && c.interface_granules <= c.spheres &&
                       (bed_.ranks.count > 1 || (c.interface_granules == c.spheres && c.with_mass == 1));
    if (!whole && !shell)
      broken("of the " + std::to_string(c.spheres) + " spheres of clump " + std::to_string(number) + " " +
             std::to_string(c.stored) + " are stored and " + std::to_string(c.interface_granules) + " are in the shell, " +
             std::to_string(c.with_mass) + " with its mass");
  }
}

/// Each is looked at where bodies are grouped.
void Invariants::check_contacts_across_ranks() const {
  if (bed_.ranks.count == 1) return;
  std::set<std::pair<std::int64_t, std::int64_t>> reviewed;
  const FrozenContacts& contacts = bed_.solid.contacts();
  contacts.for_each_to_review([&](std::int64_t low, std::int64_t high) { reviewed.emplace(low, high); });
  const SolidBodies& bodies = bed_.solid.bodies();
  contacts.for_each_contact([&](std::int64_t low, std::int64_t high, const double*) {
    if ((bodies.body_of(low) != 0) != (bodies.body_of(high) != 0) && !reviewed.count({low, high}))
      broken("the contact of granules " + std::to_string(low) + " and " + std::to_string(high) +
             " across ranks is not looked at");
  });
}

}  // namespace solidcull
