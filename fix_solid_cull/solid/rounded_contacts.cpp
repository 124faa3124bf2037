#include "rounded_contacts.h"

#include <algorithm>

#include "contacts_in_store.h"
#include "solid_state.h"

namespace solidcull {

void RoundedContacts::set_layout(const std::vector<bool>& flips, const std::vector<int>& vectors) {
  flips_ = flips;
  vectors_ = vectors;
  packed_.set_layout(width(), vectors);
}

void RoundedContacts::find(std::int64_t tag, std::vector<std::int64_t>& partners) const {
  contacts_in_store(store_, bodies_, tag, SolidStateLaw::gap, partners);
}

std::vector<char> RoundedContacts::pack(const Resident& g, const ContactList& contacts, bool all_given, Tail& tail) {
  std::vector<char> kept(contacts.size());
  std::vector<std::int64_t> partners;
  std::vector<Resident> near;
  if (!all_given) contacts_in_store(store_, bodies_, g, SolidStateLaw::gap, near);
  for (const Resident& other : near) partners.push_back(other.tag);
  for (std::size_t k = 0; k < contacts.size(); ++k) partners.push_back(contacts.partner(k));
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const std::int64_t partner = contacts.partner(k);
    const auto other = contacts.stored(k, store_);
    const double touch = other ? (1 + SolidStateLaw::gap) * (g.radius + other->radius) : 0;
    if (!other || (!contacts.history(k) && apart(g, *other).norm() > touch)) continue;  // spheres of one clump are tied
    kept[k] = true;
    forget_alike(*other, g.tag);
    const bool confused = std::any_of(partners.begin(), partners.end(),
                                      [&](std::int64_t p) { return p != partner && PackedHistory::alike(p, partner); });
    if (contacts.history(k) && width() > 0 && !confused) packed_.pack(partner, contacts.history(k), apart(g, *other), tail);
  }
  return kept;
}

std::size_t RoundedContacts::place_in(WordView list, std::int64_t partner) const {
  const std::size_t at = packed_.find(list, partner);
  return at < list.size() ? at : nowhere;
}

void RoundedContacts::erase_from(const Resident& keeper, std::size_t at) {
  const WordView words = store_.tail(keeper);
  Tail list(words.begin(), words.end());
  const auto first = list.begin() + static_cast<std::ptrdiff_t>(at);
  list.erase(first, first + static_cast<std::ptrdiff_t>(packed_.words()));
  store_.set_tail(keeper, list);
}

/// What a granule keeps of another one that it would confuse with this one goes.
void RoundedContacts::forget_alike(const Resident& keeper, std::int64_t tag) {
  const std::size_t at = place_in(store_.tail(keeper), tag);
  if (at != nowhere) erase_from(keeper, at);
}

bool RoundedContacts::history(const Resident& g, std::int64_t partner, double* history) const {
  const Resident other = *store_.find(partner);
  const WordView own = store_.tail(g), others = store_.tail(other);
  std::size_t at = place_in(own, partner);
  if (at != nowhere) {
    packed_.unpack(own.begin() + at, apart(g, other), history);
    return true;
  }
  at = place_in(others, g.tag);
  if (at == nowhere) return false;
  packed_.unpack(others.begin() + at, apart(other, g), history);
  change_side(history);
  return true;
}

void RoundedContacts::unpack(const Resident& g, ContactList& contacts) {
  std::vector<Resident> partners;
  contacts_in_store(store_, bodies_, g, SolidStateLaw::gap, partners);
  std::vector<double> numbers(width());
  for (const Resident& partner : partners) {
    const WordView own = store_.tail(g), others = store_.tail(partner);
    std::size_t at = place_in(own, partner.tag);
    if (at != nowhere) {
      packed_.unpack(own.begin() + at, apart(g, partner), numbers.data());
    } else {
      at = place_in(others, g.tag);
      if (at != nowhere) {
        packed_.unpack(others.begin() + at, apart(partner, g), numbers.data());
        change_side(numbers.data());
        erase_from(partner, at);
      }
    }
    contacts.add(partner.tag, at != nowhere ? numbers.data() : nullptr);
  }
}

void RoundedContacts::turn(int body, const Eigen::Matrix3d& by) {
  std::vector<Resident> granules, partners;
  store_.for_each_of_body(body, [&](const Resident& g) { granules.push_back(g); });
  std::vector<double> numbers(width());
  Tail turned;
  for (const Resident& g : granules) {
    const WordView tail = store_.tail(g);
    if (tail.empty()) continue;
    partners.clear();
    contacts_in_store(store_, bodies_, g, SolidStateLaw::gap, partners);
    turned.clear();
    for (const Resident& partner : partners) {
      const std::size_t at = place_in(tail, partner.tag);
      if (at == nowhere) continue;
      const Vec3 normal = apart(g, partner);
      packed_.unpack(tail.begin() + at, normal, numbers.data());
      InnerContacts::turn(numbers.data(), by);
      packed_.pack(partner.tag, numbers.data(), by * normal, turned);
    }
    store_.set_tail(g, turned);
  }
}

}  // namespace solidcull
