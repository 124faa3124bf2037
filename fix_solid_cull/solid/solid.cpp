#include "solid.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "exact_contacts.h"
#include "rounded_contacts.h"
#include "site_contacts.h"

namespace solidcull {
namespace {

// how far a free site is looked for: at first, and in the end (diameters)
constexpr double near_site = 1.5, far_site = 50;
constexpr double at_a_site = 1e-6;  // radii
// of what is stored: what is put away at once and is less leaves its contacts in the graph. Of 1,280,000 granules that a blow
// strikes 280,000 wake and sleep again, some thousands in a look; to pack these as well took 1.4 s of 64.
constexpr double pack_share = 0.5;

}  // namespace

// ------------------------------------------------------------------------------------------------------------ the deck

void Solid::open_store() {
  const double cell = 2 * scales_.diameter();
  using Precision = GranuleStore::Precision;
  if (scales_.refills()) {
    sites_ = std::make_unique<Sites>(scales_.diameter());
    store_ = std::make_unique<GranuleStore>(cell, *sites_);
    inner_ = std::make_unique<SiteContacts>(*store_, bodies_);
  } else if (scales_.compact()) {
    store_ = std::make_unique<GranuleStore>(cell, Precision::rounded);
    inner_ = std::make_unique<RoundedContacts>(*store_, bodies_);
  } else {
    store_ = std::make_unique<GranuleStore>(cell, Precision::exact);
    inner_ = std::make_unique<ExactContacts>(*store_, bodies_);
  }
  bodies_.set_elsewhere([this](std::int64_t tag) { return store_->body_of(tag); });
  inner_->set_layout(contacts_.layout(), contacts_.vectors());
  contacts_.set_elsewhere([this](std::int64_t tag, std::vector<std::int64_t>& partners) { inner_->find(tag, partners); });
}

bool Solid::set_histories(const std::vector<bool>& flips, const std::vector<int>& vectors) {
  const bool stored = inner_ && inner_->keeps_histories() && store_->size() > 0;
  if ((contacts_.size() > 0 || stored) && flips != contacts_.layout()) return false;
  if (stored && vectors != contacts_.vectors()) return false;
  contacts_.set_layout(flips);
  contacts_.set_vectors(vectors);
  if (inner_) inner_->set_layout(flips, vectors);
  return true;
}

bool Solid::set_granules_turn(bool on) {
  if (on != bodies_.granules_turn() && has_store() && locked() > 0) return false;
  bodies_.set_granules_turn(on);
  return true;
}

void Solid::know_radius(int type, double radius) {
  double& largest = largest_radius_by_type_[static_cast<std::size_t>(type)];
  largest = std::max(largest, radius);
}

// ------------------------------------------------------------------------------------------------------------ what there is

double Solid::kinetic_energy(int body) const { return exists(body) ? bodies_.body(body).part().kinetic_energy() : 0.0; }

/// Spheres of a clump are tied to each other.
void Solid::add_rest_of_clumps(std::vector<std::int64_t>& tags) const {
  FlatMap<char> seen;
  for (const std::int64_t tag : tags) seen[tag] = 1;
  for (std::size_t at = 0; at < tags.size(); ++at) {
    const int clump = store_->get(tags[at]).clump;
    if (clump == 0) continue;
    contacts_.for_each_partner(tags[at], [&](std::int64_t partner) {
      if (seen.contains(partner) || !store_->contains(partner) || store_->get(partner).clump != clump) return;
      seen[partner] = 1;
      tags.push_back(partner);
    });
  }
}

Vec3 Solid::home_of(std::int64_t tag) const {
  const StoredGranule g = store_->get(tag);
  Vec3 home = g.position;
  if (g.clump == 0 || g.has_clump) return home;
  contacts_.for_each_partner(tag, [&](std::int64_t partner) {
    if (!store_->contains(partner)) return;
    const StoredGranule other = store_->get(partner);
    if (other.clump == g.clump && other.has_clump) home = other.position;
  });
  return home;
}

// ------------------------------------------------------------------------------------------------------------ bodies

void Solid::split(const MassOf& mass_of) {
  std::set<int> came_off;
  bodies_.split(contacts_, mass_of, [&](std::int64_t tag, int body, const Vec3& place) {
    came_off.insert(body);
    if (!store_->contains(tag)) {
      tell([&](BodyFollower& f) { f.came_off(tag, body, place); });
      return;
    }
    const int from = store_->body_of(tag);
    if (store_->frame_of(from) == GranuleStore::shared_frame) store_->share(body, true);
    wall_loads_.move(tag, from, body);
    const Resident g = *store_->find(tag);
    changed(from, {g.position, g.radius});
    store_->move(tag, body, place);
    if (place != g.position) store_->shift_clump(tag, place - g.position);
  });
  if (!scales_.sleeping()) return;
  came_off.insert(bodies_.split_parents().begin(), bodies_.split_parents().end());
  for (const int body : came_off)
    if (exists(body)) find_grid(body);
}

void Solid::turn_contacts(std::int64_t tag, const Eigen::Matrix3d& by) {
  contacts_.turn(tag, by, [&](std::int64_t partner) { return partner > tag || !bodies_.body_of(partner); });
}

void Solid::adopt_swallowed() {
  for (const auto& gone : bodies_.swallowed()) {
    const int body = bodies_.root(gone.first);
    const Pose &from = gone.second, &to = bodies_.pose(body);
    const bool same = from == to;
    const Eigen::Matrix3d turn = to.turn().transpose() * from.turn();
    if (!same) inner_->turn(gone.first, turn);
    if (store_->holds(gone.first) && store_->frame_of(gone.first) != GranuleStore::shared_frame)
      ++standing_version_;  // its granules may stand from now on
    std::vector<std::int64_t> moved;
    if (sites_ && !same) {
      store_->for_each_of_body(gone.first, [&](const Resident& g) { moved.push_back(g.tag); });
      for (const std::int64_t tag : moved)
        contacts_.for_each_elsewhere(tag, [&](std::int64_t partner) { contacts_.add(tag, partner, nullptr); });
    }
    store_->merge(gone.first, body, [&](StoredGranule& g) {
      if (same) {
        changed(body, {g.position, g.radius});
        return;
      }
      g.position = to.to_frame(from.to_world(g.position));
      if (g.has_clump) g.of_clump.reframe(from, to);
      g.load_change = turn * g.load_change;
      turn_contacts(g.tag, turn);
      if (sites_) {
        const Vec3 site = free_site(body, g.position, g.radius);
        bodies_.relocate(body, {g.mass, g.position, g.radius, g.held}, site);
        g.position = site;
      }
      changed(body, {g.position, g.radius});
    });
    for (const std::int64_t tag : moved) drop_what_is_known(tag);
    wall_loads_.merge(gone.first, body);
    tell([&](BodyFollower& f) { f.merged(gone.first, body, same); });
    if (scales_.sleeping()) find_grid(body);
  }
  bodies_.forget_swallowed();
}

void Solid::ground(int body, bool on) {
  SolidBody& b = bodies_.body(body);
  if (b.grounded == on) return;
  b.ground(on);
  grounded_or_let_go(body);
}

void Solid::stand_as(int body, const SolidBody& from, double mass) {
  if (!from.grounded) return;
  SolidBody& b = bodies_.body(body);
  const bool stood = b.grounded;
  b.stand_as(from, mass);
  if (!stood) grounded_or_let_go(body);
}

void Solid::grounded_or_let_go(int body) {
  if (stands(body) && store_->holds(body)) ++standing_version_;
  tell([&](BodyFollower& f) { f.grounded_or_let_go(body); });
  find_grid(body);
}

int Solid::found(const SolidBody& body) {
  const int number = bodies_.found(body);
  if (body.grounded) find_grid(number);
  return number;
}

void Solid::reframe_one(int body, const GranuleMass& in_world) {
  bodies_.body(body).reframe_one(in_world, bodies_.turning_radius(in_world.radius));
  tell([&](BodyFollower& f) { f.frame_changed(body); });
}

/// Bodies that stand still and have never moved share the world's frame.
void Solid::find_grid(int body) {
  const SolidBody& b = bodies_.body(body);
  const bool shares = b.grounded && b.pose == Pose();
  if (!shares && store_->frame_of(body) == GranuleStore::shared_frame) tell([&](BodyFollower& f) { f.left_shared_grid(body); });
  store_->share(body, shares);
}

void Solid::forget(int body) {
  store_->forget(body);
  tell([&](BodyFollower& f) { f.forgotten(body); });
}

// ------------------------------------------------------------------------------------------------------------ contacts

void Solid::turn_frozen() {
  contacts_.turn_all_unturned([&](std::int64_t low, std::int64_t high) -> Eigen::Matrix3d {
    const int body = bodies_.body_of(low);
    return bodies_.pose(body ? body : bodies_.body_of(high)).turn().transpose();
  });
}

void Solid::leave_rank(std::int64_t tag) {
  struct Kept {
    std::int64_t tag, partner;
    std::vector<double> history;  // as tag sees it
  };
  std::vector<Kept> kept;
  contacts_.for_each(tag, [&](std::int64_t partner, const double* history) {
    if (bodies_.body_of(partner)) kept.push_back({partner, tag, history ? contacts_.turned(history) : std::vector<double>()});
  });
  contacts_.erase(tag);
  for (const Kept& c : kept) contacts_.add(c.tag, c.partner, c.history.empty() ? nullptr : c.history.data());
}

// ------------------------------------------------------------------------------------------------------------ the store

/// What the store keeps of the contacts of g leaves the graph: for its row's tail.
InnerContacts::Tail Solid::take_from_graph(const StoredGranule& g, bool all_given) {
  InnerContacts::Tail tail;
  ContactList contacts(contacts_.width());
  contacts_.for_each_here(g.tag, [&](std::int64_t partner, const double* history) {
    if (const auto stored = store_->find(partner)) contacts.add(partner, history, &*stored);
  });
  if (contacts.size() == 0) return tail;
  const std::vector<char> kept = inner_->pack({g.position, g.radius, g.tag, g.body}, contacts, all_given, tail);
  std::size_t k = 0;  // in the same order
  contacts_.drop(g.tag, [&](std::int64_t partner) { return k < contacts.size() && contacts.partner(k) == partner && kept[k++]; });
  return tail;
}

/// The store says itself which body the granule is in.
void Solid::entered_store(std::int64_t tag) {
  bodies_.leave(tag);
  if (!inner_->keeps_histories()) contacts_.forget_histories(tag);
}

void Solid::enter_store(std::int64_t tag) {
  if (inner_->packs_always() || is_large(store_->size())) {
    const InnerContacts::Tail tail = take_from_graph(store_->get(tag), true);
    if (!tail.empty()) store_->set_tail(*store_->find(tag), tail);
  }
  entered_store(tag);
}

/// Those of its contacts in the graph that are known from where granules lie.
void Solid::drop_what_is_known(std::int64_t tag) {
  std::vector<std::int64_t> told;
  contacts_.for_each_elsewhere(tag, [&](std::int64_t partner) { told.push_back(partner); });
  contacts_.drop(tag, [&](std::int64_t partner) { return std::find(told.begin(), told.end(), partner) != told.end(); });
}

void Solid::leaves_store(std::int64_t tag) {
  const Resident g = *store_->find(tag);
  bodies_.take_in(tag, g.body);
  ContactList contacts(contacts_.width());
  inner_->unpack(g, contacts);
  for (std::size_t k = 0; k < contacts.size(); ++k) contacts_.add(tag, contacts.partner(k), contacts.history(k));
}

/// Where a granule must go, however far that is. What is at a site already stays, taken or not: it may come from another rank.
/// Where all is taken, two share a site.
Vec3 Solid::free_site(int body, const Vec3& place, double radius) const {
  const Vec3 nearest = sites_->place(sites_->nearest(place, radius));
  if ((nearest - place).norm() < at_a_site * radius) return nearest;
  for (double reach = near_site; reach < far_site; reach *= 2)
    if (const auto site = store_->free_site(body, place, radius, reach, [](const Vec3&) { return true; })) return *site;
  return nearest;
}

StoredGranule Solid::as_stored(const StoredGranule& g) {
  if (sites_) {
    StoredGranule at_site = g;
    at_site.position = free_site(g.body, g.position, g.radius);
    relocate(g.body, {g.mass, g.position, g.radius, g.held}, at_site.position);
    return store_->rounded(at_site);
  }
  const StoredGranule kept = store_->rounded(g);
  // else many small ways add up when they leave
  if (scales_.compact() && g.clump == 0) bodies_.shift(g.body, {g.mass, g.position, g.radius, g.held}, kept.position);
  return kept;
}

void Solid::expects(std::size_t granules) {
  const std::size_t stored = store_->size();
  const bool many = pack_from_ == 0 || static_cast<double>(granules) >= pack_share * static_cast<double>(stored);
  packs_ = inner_->packs_always() || (many && is_large(stored + granules));
}

void Solid::put_away(const StoredGranule& g, const std::vector<double>& record, const std::vector<int>& transient,
                     const std::vector<WallLoad>& loads) {
  if (!loads.empty()) wall_loads_.add(g.tag, g.body, loads);
  const InnerContacts::Tail tail = packs_ ? take_from_graph(g, false) : InnerContacts::Tail();
  store_->add(g, record.data(), static_cast<int>(record.size()), transient, tail);
  entered_store(g.tag);
  ledger_.stored(g);
  know_radius(g.type, g.radius);
}

StoredGranule Solid::bring_back(std::int64_t tag, std::vector<double>& record) {
  leaves_store(tag);
  const StoredGranule g = store_->take(tag, record);
  ledger_.returned(g);
  wall_loads_.erase(tag, g.body);
  return g;
}

void Solid::add_stored(const StoredGranule& g, const double* record, int length) {
  store_->add(g, record, length);
  ledger_.stored(g);
  know_radius(g.type, g.radius);
  changed(g.body, {g.position, g.radius});
}

void Solid::add_stored(const StoredGranule& g, const double* record, int length, const ContactList& contacts) {
  InnerContacts::Tail tail;
  const std::vector<char> kept = inner_->pack({g.position, g.radius, g.tag, g.body}, contacts, true, tail);
  store_->add(g, record, length, {}, tail);
  ledger_.stored(g);
  know_radius(g.type, g.radius);
  for (std::size_t k = 0; k < contacts.size(); ++k)
    if (!kept[k]) contacts_.add(g.tag, contacts.partner(k), contacts.history(k));
  entered_store(g.tag);
  changed(g.body, {g.position, g.radius});
}

std::size_t Solid::fit() {
  const std::size_t before = contacts_.memory_bytes() + bodies_.member_bytes();
  contacts_.fit();
  bodies_.fit();
  return before - contacts_.memory_bytes() - bodies_.member_bytes();
}

std::size_t Solid::memory_bytes() const {
  return contacts_.memory_bytes() + bodies_.member_bytes() + (store_ ? store_->memory_bytes() : 0);
}

}  // namespace solidcull
