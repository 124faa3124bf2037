#include "site_contacts.h"

#include <algorithm>

#include "contacts_in_store.h"

namespace solidcull {
namespace {

// what is no farther apart hangs together
constexpr double gap_between_sites = 0.3;  // of the radii's sum

}  // namespace

void SiteContacts::set_layout(const std::vector<bool>& flips, const std::vector<int>& vectors) {
  flips_ = flips;
  vectors_ = vectors;
}

void SiteContacts::find(std::int64_t tag, std::vector<std::int64_t>& partners) const {
  contacts_in_store(store_, bodies_, tag, gap_between_sites, partners);
}

std::vector<char> SiteContacts::pack(const Resident& g, const ContactList& contacts, bool /*all_given*/, Tail& /*tail*/) {
  std::vector<Resident> near;
  contacts_in_store(store_, bodies_, g, gap_between_sites, near);
  std::vector<char> kept(contacts.size());
  for (std::size_t k = 0; k < contacts.size(); ++k)
    kept[k] = std::any_of(near.begin(), near.end(), [&](const Resident& other) { return other.tag == contacts.partner(k); });
  return kept;
}

void SiteContacts::unpack(const Resident& g, ContactList& contacts) {
  std::vector<Resident> near;
  contacts_in_store(store_, bodies_, g, gap_between_sites, near);
  for (const Resident& other : near) contacts.add(other.tag, nullptr);
}

}  // namespace solidcull
