#include "inner_contacts.h"

#include <algorithm>

#include "contacts_in_store.h"
#include "solid_state.h"

namespace solidcull {

void InnerContacts::set_layout(const std::vector<bool>& flips, const std::vector<int>& vectors) {
  flips_ = flips;
  vectors_ = vectors;
  packed_.set_layout(width(), vectors);
}

void InnerContacts::find(std::int64_t tag, std::vector<std::int64_t>& partners) const {
  contacts_in_store(store_, bodies_, tag, SolidStateLaw::gap, partners);
}

std::vector<char> InnerContacts::pack(const Resident& g, const ContactList& contacts, bool all_given, Tail& tail) {
  std::vector<char> kept(contacts.size());
  std::vector<std::int64_t> partners;
  std::vector<Resident> near;
  if (!all_given) contacts_in_store(store_, bodies_, g, SolidStateLaw::gap, near);
  for (const Resident& other : near) partners.push_back(other.tag);
  for (std::size_t k = 0; k < contacts.size(); ++k) partners.push_back(contacts.partner(k));
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const std::int64_t partner = contacts.partner(k);
    const auto other = contacts.stored(k, store_);
    if (!other) continue;
    kept[k] = true;
    forget_alike(*other, g.tag);
    const bool confused = std::any_of(partners.begin(), partners.end(),
                                      [&](std::int64_t p) { return p != partner && PackedHistory::alike(p, partner); });
    if (contacts.history(k) && width() > 0 && !confused) packed_.pack(partner, contacts.history(k), apart(g, *other), tail);
  }
  return kept;
}

std::size_t InnerContacts::place_in(const Tail& list, std::int64_t partner) const {
  const std::size_t at = packed_.find(list, partner);
  return at < list.size() ? at : nowhere;
}

void InnerContacts::erase(Tail& list, std::size_t at) const {
  const auto first = list.begin() + static_cast<std::ptrdiff_t>(at);
  list.erase(first, first + static_cast<std::ptrdiff_t>(packed_.words()));
}

/// What a granule keeps of another one that it would confuse with this one goes.
void InnerContacts::forget_alike(const Resident& keeper, std::int64_t tag) {
  Tail tail;
  store_.tail(keeper, tail);
  const std::size_t at = place_in(tail, tag);
  if (at == nowhere) return;
  erase(tail, at);
  store_.set_tail(keeper, tail);
}

Vec3 InnerContacts::apart(const Resident& a, const Resident& b) const {
  const Vec3 there = b.position - a.position;
  const double reach = (1 + SolidStateLaw::gap) * (a.radius + b.radius);
  if ((bodies_.periods().array() == 0).all() || there.squaredNorm() <= reach * reach) return there;
  const Pose& pose = bodies_.pose(a.body);
  return pose.turned_to_frame(bodies_.nearest_image(pose.turned_to_world(there), Vec3::Zero()));
}

bool InnerContacts::history(const Resident& g, std::int64_t partner, double* history) const {
  const Resident other = *store_.find(partner);
  Tail tail;
  store_.tail(g, tail);
  std::size_t at = place_in(tail, partner);
  if (at != nowhere) {
    packed_.unpack(&tail[at], apart(g, other), history);
    return true;
  }
  store_.tail(other, tail);
  at = place_in(tail, g.tag);
  if (at == nowhere) return false;
  packed_.unpack(&tail[at], apart(other, g), history);
  change_side(history);
  return true;
}

void InnerContacts::unpack(const Resident& g, ContactList& contacts) {
  std::vector<Resident> partners;
  contacts_in_store(store_, bodies_, g, SolidStateLaw::gap, partners);
  std::vector<double> numbers(width());
  Tail own, others;
  store_.tail(g, own);
  for (const Resident& partner : partners) {
    std::size_t at = place_in(own, partner.tag);
    if (at != nowhere) {
      packed_.unpack(&own[at], apart(g, partner), numbers.data());
    } else {
      store_.tail(partner, others);
      at = place_in(others, g.tag);
      if (at != nowhere) {
        packed_.unpack(&others[at], apart(partner, g), numbers.data());
        change_side(numbers.data());
        erase(others, at);
        store_.set_tail(partner, others);
      }
    }
    contacts.add(partner.tag, at != nowhere ? numbers.data() : nullptr);
  }
}

void InnerContacts::turn(int body, const Eigen::Matrix3d& by) {
  std::vector<Resident> granules, partners;
  store_.for_each_of_body(body, [&](const Resident& g) { granules.push_back(g); });
  std::vector<double> numbers(width());
  Tail tail, turned;
  for (const Resident& g : granules) {
    store_.tail(g, tail);
    if (tail.empty()) continue;
    partners.clear();
    contacts_in_store(store_, bodies_, g, SolidStateLaw::gap, partners);
    turned.clear();
    for (const Resident& partner : partners) {
      const std::size_t at = place_in(tail, partner.tag);
      if (at == nowhere) continue;
      const Vec3 normal = apart(g, partner);
      packed_.unpack(&tail[at], normal, numbers.data());
      for (const int v : vectors_) {
        Eigen::Map<Vec3> vector(numbers.data() + v);
        vector = by * Vec3(vector);
      }
      packed_.pack(partner.tag, numbers.data(), by * normal, turned);
    }
    store_.set_tail(g, turned);
  }
}

}  // namespace solidcull
