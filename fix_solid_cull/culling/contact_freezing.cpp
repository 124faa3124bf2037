#include "contact_freezing.h"

#include <algorithm>
#include <numeric>
#include <tuple>

#include "chunked_array.h"

namespace solidcull {

bool ContactFreezing::is_locked(std::int64_t tag, const Changes& changes) const {
  if (const int* i = bed_.index.find(tag)) return bed_.shell[*i].locked;
  return changes.locked_anywhere.contains(tag) || (bed_.groups.ghost(tag) && !changes.freed_anywhere.contains(tag));
}

/// In this change, and not before it in the same step.
bool ContactFreezing::just_locked(int i) const {
  const Locked& e = bed_.shell[i];
  return e.locked && e.lock_step == bed_.run.step && e.came_back != bed_.run.step;
}

/// The load of a contact that goes inside stays in the balance that the older granule was locked with (invariant I5).
void ContactFreezing::rebase(int i, std::int64_t partner, const double* history) {
  if (bed_.shell[i].fresh) return;
  if (const int* j = bed_.index.find(partner)) bed_.shell.rebase(i, -bed_.contacts.force_on_first(i, *j, history));
}

void ContactFreezing::freeze(const Changes& changes, const Proposal& proposal) {
  const auto locked = [&](std::int64_t tag) { return is_locked(tag, changes); };
  TagPairs joined;
  for (const Join& j : changes.joins)
    if (locked(j.a) && locked(j.b)) joined.insert(ordered(j.a, j.b));
  // two bodies that touch stay two, and their contact the engine's, until a granule is locked that touches both, or they are
  // joined
  const auto freezes = [&](std::int64_t a, std::int64_t b) {
    return locked(b) &&
           (changes.locked_anywhere.contains(a) || changes.locked_anywhere.contains(b) || joined.count(ordered(a, b)));
  };
  const Atoms& atoms = bed_.atoms;
  const FrozenContacts& frozen = bed_.solid.contacts();
  const HistoryRows histories = bed_.contacts.histories();
  for (int i = 0; i < atoms.owned; ++i) {
    if (!bed_.shell[i].locked) continue;
    const std::int64_t tag = atoms.tag[i];
    histories.for_each_partner(i, [&](std::int64_t partner, const double* history) {
      const int* j = bed_.index.find(partner);
      if (j && just_locked(i) && just_locked(*j)) {  // most are: seen from both sides, and without contacts until now
        if (i < *j) bed_.solid.freeze(tag, partner, history);
        return;
      }
      if (!freezes(tag, partner)) return;
      if (!frozen.contains(tag, partner)) bed_.solid.freeze(tag, partner, history);
      rebase(i, partner, history);
    });
  }
  for (const Proposal::Touch& t : proposal.touches)
    if (locked(t.a) && freezes(t.a, t.b) && !frozen.contains(t.a, t.b)) {
      bed_.solid.freeze_in_frame(t.a, t.b, nullptr);
      if (frozen.width()) continue;  // touching within the gap: no force
      if (const int* a = bed_.index.find(t.a)) rebase(*a, t.b, nullptr);
      if (const int* b = bed_.index.find(t.b)) rebase(*b, t.a, nullptr);
    }
  for (const auto& [a, b] : joined)  // other ranks have told of theirs
    if ((bed_.index.contains(a) || bed_.index.contains(b)) && !frozen.contains(a, b)) bed_.solid.freeze_in_frame(a, b, nullptr);
  for (const Proposal::SideChange& c : proposal.side_changes) {
    const int* i = bed_.index.find(c.interface_tag);
    if (i && bed_.shell[*i].locked && !bed_.shell[*i].fresh && freezes(c.interface_tag, c.other_tag))
      bed_.shell.rebase(*i, -c.force);
  }
}

void ContactFreezing::freeze_between_merged() {
  if (bed_.solid.contacts().width() == 0) return;
  bed_.groups.share();
  const Atoms& atoms = bed_.atoms;
  const HistoryRows histories = bed_.contacts.histories();
  for (int i = 0; i < atoms.owned; ++i) {
    if (!bed_.shell[i].locked) continue;
    const std::int64_t tag = atoms.tag[i];
    const BodyGroups::Key own = bed_.groups.key_of(bed_.shell[i].body);
    histories.for_each_partner(i, [&](std::int64_t partner, const double* history) {
      const int* j = bed_.index.find(partner);
      if (j && just_locked(i) && just_locked(*j)) return;  // freeze() has seen to it
      const BodyGroups::Key* ghost = j ? nullptr : bed_.groups.ghost(partner);
      const BodyGroups::Key other = j       ? (bed_.shell[*j].locked ? bed_.groups.key_of(bed_.shell[*j].body) : 0)
                                    : ghost ? *ghost
                                            : 0;
      if (other != own || bed_.solid.contacts().contains(tag, partner)) return;
      bed_.solid.freeze(tag, partner, history);
      if (!j) return;
      if (!bed_.shell[i].fresh) bed_.shell.rebase(i, -bed_.contacts.force_on_first(i, *j, history));
      if (!bed_.shell[*j].fresh) bed_.shell.rebase(*j, bed_.contacts.force_on_first(i, *j, history));
    });
  }
}

void ContactFreezing::leave_out_inner_pairs() {
  inner_pairs_listed_ = false;
  if (!bed_.census.something_locked()) return;
  std::vector<BodyGroups::Key> body(static_cast<std::size_t>(bed_.atoms.owned + bed_.atoms.ghosts));
  for (std::size_t i = 0; i < body.size(); ++i) body[i] = bed_.groups.key_of_atom(static_cast<int>(i));
  bed_.contacts.leave_out_pairs_within(body);
}

void ContactFreezing::thaw(const Changes& changes) {
  std::vector<std::int64_t> freed;  // in the order of their tags: neighbours lie near each other in memory then
  freed.reserve(changes.freed_anywhere.size());
  changes.freed_anywhere.for_each([&](std::int64_t tag, char) { freed.push_back(tag); });
  std::sort(freed.begin(), freed.end());
  struct Given {
    int atom;
    std::int32_t partner;
  };
  const FrozenContacts& frozen = bed_.solid.contacts();
  const std::size_t width = frozen.width();
  constexpr std::size_t chunk_bytes = 4096;  // some hundred are given as a rule, millions where a large bed is restored
  ChunkedArray<Given> given(1, chunk_bytes);
  ChunkedArray<double> histories(width, chunk_bytes);  // in step with them
  const auto give = [&](const int* atom, std::int64_t partner, const double* history) {
    if (!atom) return static_cast<double*>(nullptr);
    given[given.append()] = {*atom, static_cast<std::int32_t>(partner)};
    double* const numbers = histories.row(histories.append());
    std::copy(history, history + width, numbers);
    return numbers;
  };
  const SolidBodies& bodies = bed_.solid.bodies();
  for (const std::int64_t tag : freed) {
    const int* mine = bed_.index.find(tag);
    const int own = bodies.body_of(tag);
    frozen.for_each(tag, [&](std::int64_t partner, const double* history) {
      if (!history || (partner < tag && changes.freed_anywhere.contains(partner))) return;
      const Eigen::Matrix3d& turn = bodies.pose(own ? own : bodies.body_of(partner)).turn();
      if (double* const h = give(mine, partner, history)) frozen.turn(h, turn);
      if (double* const h = give(bed_.index.find(partner), tag, history)) {
        frozen.turn(h, turn);
        frozen.change_side(h);
      }
    });
  }
  std::vector<std::uint32_t> by_atom(given.size());
  std::iota(by_atom.begin(), by_atom.end(), 0u);
  std::sort(by_atom.begin(), by_atom.end(),
            [&](std::uint32_t a, std::uint32_t b) { return std::tie(given[a].atom, a) < std::tie(given[b].atom, b); });
  std::vector<Contacts::History> of_one;
  for (std::size_t g = 0; g < by_atom.size();) {
    const int atom = given[by_atom[g]].atom;
    of_one.clear();
    for (; g < by_atom.size() && given[by_atom[g]].atom == atom; ++g)
      of_one.push_back({given[by_atom[g]].partner, histories.row(by_atom[g])});
    bed_.contacts.give_histories(atom, of_one.data(), of_one.size());
  }
  thawed_ = changes.freed_anywhere;
}

void ContactFreezing::rebase_thawed() {
  if (thawed_.empty()) return;
  const Atoms& atoms = bed_.atoms;
  const int owned = atoms.owned;
  bed_.contacts.neighbours().for_each_pair(owned, [&](int i, int j, int k) {
    const bool stays = bed_.shell[i].locked && !bed_.shell[i].fresh && thawed_.contains(atoms.tag[j]);
    const bool other_stays = j < owned && bed_.shell[j].locked && !bed_.shell[j].fresh && thawed_.contains(atoms.tag[i]);
    if (!stays && !other_stays) return;
    const double reach = (atoms.radius[i] + atoms.radius[j]) * bed_.contacts.reach_factor;
    if ((atoms.place(i) - atoms.place(j)).squaredNorm() > reach * reach) return;
    const Vec3 f = bed_.contacts.force_on_first(i, k);
    if (stays) bed_.shell.rebase(i, f);
    if (other_stays) bed_.shell.rebase(j, -f);
  });
  thawed_.clear();
}

}  // namespace solidcull
