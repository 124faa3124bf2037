#include "exact_contacts.h"

#include "contacts_in_store.h"
#include "solid_state.h"

namespace solidcull {
namespace {

// of the radii's sum: who touched when they were stored are found by their places, which turn with a body since
constexpr double found_within = SolidStateLaw::gap + 1e-6;

}  // namespace

void ExactContacts::set_layout(const std::vector<bool>& flips, const std::vector<int>& vectors) {
  flips_ = flips;
  vectors_ = vectors;
  bits_.set_layout(width(), vectors);
}

/// They are found from each other's place for as long as both are stored.
bool ExactContacts::are_together(const Resident& a, const Resident& b) const {
  return bodies_.root(a.body) == bodies_.root(b.body) && store_.frame_of(a.body) == store_.frame_of(b.body) &&
         apart(a, b).norm() <= (1 + SolidStateLaw::gap) * (a.radius + b.radius);
}

/// From either side, so that a history is rounded alike whichever of the two keeps it.
Vec3 ExactContacts::normal(const Resident& a, const Resident& b) const { return a.tag < b.tag ? apart(a, b) : apart(b, a); }

/// Calls visit(partner) for those that keep a contact with g.
template <class Visit>
void ExactContacts::for_each_keeper(const Resident& g, Visit visit) const {
  near_.clear();
  contacts_in_store(store_, bodies_, g, found_within, near_);
  for (const Resident& other : near_)
    if (ContactTail::names(store_.tail(other), g.tag)) visit(other);
}

void ExactContacts::find(std::int64_t tag, std::vector<std::int64_t>& partners) const {
  const auto g = store_.find(tag);
  if (!g) return;
  ContactTail::for_each(store_.tail(*g), [&](std::int64_t partner) { partners.push_back(partner); });
  for_each_keeper(*g, [&](const Resident& other) { partners.push_back(other.tag); });
}

std::vector<char> ExactContacts::pack(const Resident& g, const ContactList& contacts, bool, Tail& tail) {
  std::vector<char> kept(contacts.size());
  own_.clear();
  for (std::size_t k = 0; k < contacts.size(); ++k)
    if (const auto other = contacts.stored(k, store_))
      kept[k] = are_together(g, *other) && own_.add(contacts.partner(k), contacts.history(k), normal(g, *other));
  own_.write(tail);
  return kept;
}

bool ExactContacts::history(const Resident& g, std::int64_t partner, double* history) const {
  const Resident other = *store_.find(partner);
  if (const WordView words = store_.tail(g); ContactTail::names(words, partner)) {
    const ContactTail list(bits_, words);
    return list.history(list.find(partner), normal(g, other), history);
  }
  const ContactTail list(bits_, store_.tail(other));
  const std::size_t at = list.find(g.tag);
  if (at == ContactTail::none || !list.history(at, normal(g, other), history)) return false;
  change_side(history);
  return true;
}

void ExactContacts::unpack(const Resident& g, ContactList& contacts) {
  std::vector<double> numbers(width());
  own_.read(store_.tail(g));
  for (std::size_t at = 0; at < own_.size(); ++at) {
    const std::int64_t partner = own_.partner(at);
    const bool known = own_.history(at, normal(g, *store_.find(partner)), numbers.data());
    contacts.add(partner, known ? numbers.data() : nullptr);
  }
  for_each_keeper(g, [&](const Resident& keeper) {
    other_.read(store_.tail(keeper));
    const std::size_t at = other_.find(g.tag);
    const bool known = other_.history(at, normal(g, keeper), numbers.data());
    if (known) change_side(numbers.data());
    contacts.add(keeper.tag, known ? numbers.data() : nullptr);
    other_.erase(at);
    other_.write(words_);
    store_.set_tail(keeper, words_);
  });
}

void ExactContacts::turn(int body, const Eigen::Matrix3d& by) {
  if (vectors_.empty()) return;
  std::vector<Resident> granules;
  store_.for_each_of_body(body, [&](const Resident& g) { granules.push_back(g); });
  std::vector<double> numbers(width());
  for (const Resident& g : granules) {
    own_.read(store_.tail(g));
    other_.clear();
    for (std::size_t at = 0; at < own_.size(); ++at) {
      const Vec3 direction = normal(g, *store_.find(own_.partner(at)));
      const bool known = own_.history(at, direction, numbers.data());
      if (known) InnerContacts::turn(numbers.data(), by);
      other_.add(own_.partner(at), known ? numbers.data() : nullptr, by * direction);
    }
    other_.write(words_);
    store_.set_tail(g, words_);
  }
}

}  // namespace solidcull
