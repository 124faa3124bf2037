#include "shown_bed.h"

#include <algorithm>
#include <string>

#include "clump_numbers.h"
#include "store_exchange.h"
#include "word_sum.h"

namespace solidcull {
namespace {

// so many granules' rows are kept for the next time: decks loop over commands and runs
constexpr std::size_t worth_freeing = 100000;

}  // namespace

// ------------------------------------------------------------------------------------------------------------ out

/// Of all but its motion.
std::uint64_t ShownBed::sum_of(const std::vector<double>& record) const {
  WordSum sum;
  auto motion = motion_words_.begin();
  for (std::size_t k = 0; k < record.size(); ++k) {
    if (motion != motion_words_.end() && static_cast<std::size_t>(*motion) == k) {
      ++motion;
      continue;
    }
    sum.add(record[k]);
  }
  return sum.value();
}

void ShownBed::show() {
  names_.assign(static_cast<std::size_t>(bed_.atoms.room), Name());
  granules_.clear();
  interface_.clear();
  clumps_.clear();
  spheres_.clear();
  shown_ = true;
  show_interface();
  show_stored();
  if (bed_.clumps.possible) join_images();
}

/// The engine has it as it would be now.
void ShownBed::show_clump(int sphere, std::int64_t tag, Clump c, int body, bool as_it_was) {
  c.lies = c.lies.in_world(bed_.solid.bodies().pose(body));
  const Twist& twist = bed_.solid.bodies().body(body).twist;
  if (!as_it_was) c.move_as(twist.at(c.lies.centre), twist.spin);
  bed_.clumps.put(c, sphere);
  std::vector<double> numbers;
  solidcull::pack(bed_.clumps.clump(bed_.clumps.find(c.number)), numbers);
  clumps_[c.number] = {tag, granules_.size() - 1, std::move(numbers)};
}

/// Spheres of a clump that was stored are in the periodic image in which its centre is.
void ShownBed::join_images() {
  FlatMap<int> first;
  for (const auto& [i, clump] : spheres_)
    if (clumps_.at(clump).tag == bed_.atoms.tag[i]) first[clump] = i;
  for (const auto& [i, clump] : spheres_) {
    if (const int* to = first.find(clump)) bed_.clumps.join_image(i, *to);
    bed_.clumps.set_clump(i, clump);
  }
}

void ShownBed::show_interface() {
  Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned; ++i) {
    if (!bed_.shell.locked(i)) continue;
    const Locked& e = bed_.shell[i];
    interface_.push_back({e, atoms.velocity(i), atoms.spin(i)});
    if (e.lock_step == bed_.run.step) {  // no step has passed since: the deck sees the motion that it had
      atoms.set_velocity(i, e.velocity);
      if (bed_.contacts.turn_granules) atoms.set_spin(i, e.spin);
    }
    note(i, false, e.clump, 0);
    if (e.clump == 0) continue;
    bed_.clumps.set_clump(i, e.clump);
    if (const Clump* c = bed_.locked_clumps.find(atoms.tag[i]))
      show_clump(i, atoms.tag[i], *c, e.body, e.lock_step == bed_.run.step);
  }
}

void ShownBed::show_stored() {
  Atoms& atoms = bed_.atoms;
  const bool by_place = !bed_.run.any_periodic() || bed_.scales.image_by_place();
  const Vec3 middle = 0.5 * (bed_.run.box.lo + bed_.run.box.hi);
  motion_words_.clear();
  bed_.solid.store().for_each_record([&](const StoredGranule& g, const std::vector<double>& record, bool transient_known) {
    const int i = atoms.put_back(record, g.layout);
    if (motion_words_.empty()) motion_words_ = atoms.motion_words(i, by_place, bed_.contacts.turn_granules);
    if (!transient_known) {
      const SolidBody& body = bed_.solid.bodies().body(g.body);
      const Vec3 x = body.pose.to_world(g.position);
      atoms.set_place(i, bed_.solid.nearest_image(x, bed_.scales.image_by_place() ? middle : atoms.place(i)));
      atoms.set_velocity(i, body.twist.at(x));
      if (bed_.contacts.turn_granules) atoms.set_spin(i, body.twist.spin);
    }
    bed_.shell.label(i, bed_.groups.key_of(g.body));
    note(i, true, g.clump, sum_of(record));
    atoms.mark_interface(i, false);
    if (g.clump) spheres_.emplace_back(i, g.clump);
    if (g.has_clump) show_clump(i, g.tag, StoreExchange::clump_of(record, g), g.body, transient_known);
  });
}

void ShownBed::note(int i, bool stored, bool of_clump, std::uint64_t sum) {
  const Atoms& atoms = bed_.atoms;
  names_[static_cast<std::size_t>(i)] = {bed_.ranks.me, static_cast<std::int32_t>(granules_.size())};
  granules_.push_back({atoms.tag[i], stored, of_clump, false, atoms.place(i), atoms.velocity(i), atoms.spin(i), atoms.radius[i],
                       atoms.mass[i], atoms.type[i], sum});
}

void ShownBed::stand_in_for_missing(Arrivals& arrivals) const {
  for (std::size_t k = 0; k < interface_.size(); ++k) {
    const Locked& e = interface_[k].state;
    arrivals.announce(granules_[k].tag, {e.body, {granules_[k].mass, e.place, granules_[k].radius, e.held, std::nullopt}});
  }
}

// ------------------------------------------------------------------------------------------------------------ contacts

ShownBed::KnownContacts ShownBed::contacts_of(const HistoryRows& rows, int i, std::int64_t tag) {
  KnownContacts c{tag, {}, {}};
  rows.for_each_partner(i, [&](std::int64_t partner, const double* history) {
    c.partners.push_back(partner);
    c.numbers.insert(c.numbers.end(), history, history + rows.width);
  });
  return c;
}

/// With other locked granules of its body; without those that have no history.
ShownBed::KnownContacts ShownBed::contacts_in_body(std::int64_t tag, bool stored, int body) const {
  const FrozenContacts& frozen = bed_.solid.contacts();
  KnownContacts c{tag, {}, {}};
  std::vector<double> history(frozen.width());
  const auto add = [&](std::int64_t partner) {
    frozen.turn(history.data(), bed_.solid.bodies().pose(body).turn());
    c.partners.push_back(partner);
    c.numbers.insert(c.numbers.end(), history.begin(), history.end());
  };
  frozen.for_each_here(tag, [&](std::int64_t partner, const double* known) {
    if (!known) return;
    history.assign(known, known + frozen.width());
    add(partner);
  });
  if (!stored) return c;
  const auto granule = bed_.solid.store().find(tag);
  frozen.for_each_elsewhere(tag, [&](std::int64_t partner) {
    if (bed_.solid.inner_history(*granule, partner, history.data())) add(partner);
  });
  return c;
}

void ShownBed::give(int i, const KnownContacts& contacts) {
  const std::size_t width = bed_.solid.contacts().width();
  std::vector<Contacts::History> rows;
  for (std::size_t k = 0; k < contacts.partners.size(); ++k)
    rows.push_back({contacts.partners[k], contacts.numbers.data() + k * width});
  bed_.contacts.give_histories(i, rows.data(), rows.size());
}

void ShownBed::give_contacts() {
  outer_.clear();
  if (!shown_ || bed_.solid.contacts().width() == 0) return;
  AtomIndex atoms;  // guests are in none of the culling's own
  atoms.index(bed_.atoms);
  const HistoryRows rows = bed_.contacts.histories();
  for (std::size_t k = 0; k < granules_.size(); ++k) {
    const Shown& s = granules_[k];
    const int* i = atoms.find(s.tag);
    if (!i) continue;  // the deck has deleted it, or sent it to another rank
    if (!s.stored) outer_.push_back(contacts_of(rows, *i, s.tag));
    const int body = s.stored ? bed_.solid.store().find(s.tag)->body : interface_[k].state.body;
    give(*i, contacts_in_body(s.tag, s.stored, body));
  }
}

void ShownBed::take_contacts() {
  if (!shown_ || bed_.solid.contacts().width() == 0) return;
  AtomIndex atoms;
  atoms.index(bed_.atoms);
  for (const Shown& s : granules_)
    if (const int* i = atoms.find(s.tag)) bed_.contacts.clear_histories(*i);
  for (const KnownContacts& c : outer_)
    if (const int* i = atoms.find(c.tag)) give(*i, c);
  outer_.clear();
}

// ------------------------------------------------------------------------------------------------------------ back

void ShownBed::hide() {
  Atoms& atoms = bed_.atoms;
  changes_.clear();
  asking_.clear();
  groups_of_guests_ = 0;
  std::vector<int> at(granules_.size(), gone);
  bring_strangers_home(at);
  if (bed_.clumps.possible) take_clumps(at);
  for (std::size_t k = 0; k < granules_.size(); ++k) judge(k, at[k]);

  std::vector<int> guests;
  for (std::size_t k = 0; k < granules_.size(); ++k)
    if (granules_[k].stored && at[k] != gone) guests.push_back(at[k]);
  std::sort(guests.rbegin(), guests.rend());
  for (const int i : guests) atoms.take_out(i);

  changed_ = bed_.ranks.any(!changes_.empty() || !changed_clumps_.empty());
  bed_.wake.ask_many(bed_.ranks, asking_, bed_.scales.wake_up(), bed_.solid.locked());
  shown_ = false;
  if (granules_.capacity() < worth_freeing) return;
  names_ = {};
  granules_ = {};
  interface_ = {};
  asking_ = {};
}

/// Those that stay culled are no clumps to the engine; what the deck did to one wakes it.
void ShownBed::take_clumps(const std::vector<int>& at) {
  changed_clumps_.clear();
  for (std::size_t k = 0; k < granules_.size(); ++k)
    if (at[k] != gone) bed_.clumps.set_clump(at[k], 0);
  std::vector<std::pair<int, int>> asked;
  for (const auto& [number, c] : clumps_) {
    if (at[c.number] != gone)
      asked.emplace_back(number, at[c.number]);
    else if (bed_.clumps.find(number) >= 0)
      bed_.clumps.take(number);
  }
  std::vector<double> numbers;
  for (Clump& c : bed_.clump_spheres.take(asked)) {
    const ShownClump& then = clumps_.at(c.number);
    numbers.clear();
    solidcull::pack(c, numbers);
    if (numbers == then.numbers) continue;
    asking_.push_back(granules_[then.number].place);
    changed_clumps_[c.number] = std::move(c);
  }
}

/// A command may have sent granules to other ranks; they go back to where their bodies are.
void ShownBed::bring_strangers_home(std::vector<int>& at) {
  Atoms& atoms = bed_.atoms;
  std::vector<double> mine, record;
  for (int i = atoms.owned - 1; i >= 0; --i) {
    const Name& name = names_[static_cast<std::size_t>(i)];
    if (name.home == nobody || name.home == bed_.ranks.me) continue;
    int layout = 0;
    atoms.pack(i, record, layout);
    const std::string text = atoms.layout_text(layout);
    mine.insert(mine.end(), {double(name.home), double(name.number), double(text.size()), double(record.size())});
    mine.insert(mine.end(), text.begin(), text.end());
    mine.insert(mine.end(), record.begin(), record.end());
    bed_.shell.reset(i);
    atoms.take_out(i);
  }
  if (bed_.ranks.any(!mine.empty())) {
    const std::vector<double> all = bed_.ranks.gather(mine);
    for (const double* row = all.data(); row != all.data() + all.size();) {
      const int home = static_cast<int>(row[0]), number = static_cast<int>(row[1]);
      const double *const text = row + 4, *const numbers = text + static_cast<std::size_t>(row[2]);
      row = numbers + static_cast<std::size_t>(row[3]);
      if (home != bed_.ranks.me) continue;
      record.assign(numbers, row);
      const int i = atoms.put_back(record, atoms.layout_from_text(std::string(text, numbers)));
      names_[static_cast<std::size_t>(i)] = {home, number};
      Shown& s = granules_[static_cast<std::size_t>(number)];
      s.has_been_away = true;
      if (!s.stored) bed_.shell.put(i, interface_[static_cast<std::size_t>(number)].state);
    }
  }
  for (int i = 0; i < atoms.owned; ++i)
    if (const Name& name = names_[static_cast<std::size_t>(i)]; name.home == bed_.ranks.me)
      at[static_cast<std::size_t>(name.number)] = i;
}

bool ShownBed::is_as_shown(const Shown& s, int i) const {
  const Atoms& atoms = bed_.atoms;
  return atoms.place(i) == s.place && atoms.velocity(i) == s.velocity && atoms.spin(i) == s.spin && atoms.radius[i] == s.radius &&
         atoms.mass[i] == s.mass && atoms.type[i] == s.type;
}

/// The engine has them elsewhere.
void ShownBed::add_numbers_of_clump(std::int64_t tag) {
  if (!bed_.solid.store().get(tag).has_clump) return;
  std::vector<double> stored;
  bed_.solid.store().record(tag, stored);
  record_.insert(record_.end(), stored.end() - static_cast<std::ptrdiff_t>(StoreExchange::numbers_of_clump(stored)),
                 stored.end());
}

/// What became of a granule, which is atom i.
void ShownBed::judge(std::size_t number, int i) {
  const Shown& s = granules_[number];
  Atoms& atoms = bed_.atoms;
  const auto wakes = [&] { asking_.push_back(s.place); };
  if (i == gone) {
    wakes();
    changes_[s.tag].deleted = true;
    return;
  }
  if (atoms.tag[i] != s.tag)
    throw InternalError("granule " + std::to_string(s.tag) + " was renumbered as " + std::to_string(atoms.tag[i]));
  // what walls and cover knew of an interface granule does not come back with it from another rank
  const bool changed = !is_as_shown(s, i) || (s.has_been_away && !s.stored);
  if (changed || !atoms.may_be_culled(i, s.of_clump)) wakes();  // or the deck holds or drives it from now on
  if (s.stored) {
    groups_of_guests_ |= atoms.groups[i];
    atoms.mark_interface(i, true);  // as it went into the store
  }
  if (changed || s.stored) {
    int layout = 0;
    atoms.pack(i, record_, layout);
    if (s.stored && bed_.clumps.possible) add_numbers_of_clump(s.tag);
    if (changed)
      changes_[s.tag] = {false, atoms.place(i) != s.place, layout, record_};
    else if (sum_of(record_) != s.sum)
      bed_.solid.set_record(s.tag, layout, record_, motion_words_);
  }
  if (s.stored) return;
  // until it wakes, or goes on in its body, it is as it was
  atoms.set_place(i, s.place);
  atoms.set_velocity(i, interface_[number].velocity);
  atoms.set_spin(i, interface_[number].spin);
  atoms.set_size(i, s.radius, s.mass);
}

void ShownBed::give_changes() {
  if (!changed_) return;
  changed_ = false;
  bed_.index.index(bed_.atoms);
  for (const auto& [tag, change] : changes_)
    if (const int* i = bed_.index.find(tag)) {  // an interface granule that was deleted is no atom any more
      give(*i, change);
    } else if (!change.deleted) {
      throw InternalError("granule " + std::to_string(tag) + " was changed and did not wake");
    }
  changes_.clear();
  for (const auto& [number, c] : changed_clumps_) {
    const int* i = bed_.index.find(clumps_.at(number).tag);
    if (!i || bed_.clumps.find(number) < 0) continue;  // deleted
    bed_.clumps.take(number);
    bed_.clumps.put(c, *i);
  }
  changed_clumps_.clear();
  const Atoms& atoms = bed_.atoms;
  bool far = false;
  for (int i = 0; i < atoms.owned && !far && bed_.ranks.count > 1; ++i) far = !bed_.ranks.owns(atoms.place(i));
  bed_.census.publish_atoms(0);
  if (bed_.ranks.any(far)) bed_.send_far();
}

/// It keeps its contacts.
void ShownBed::give(int i, const Change& change) {
  Atoms& atoms = bed_.atoms;
  const std::int64_t tag = atoms.tag[i];
  const KnownContacts contacts = contacts_of(bed_.contacts.histories(), i, tag);
  bed_.contacts.clear_histories(i);
  bed_.shell.reset(i);
  const Vec3 place = atoms.place(i);
  const int clump = bed_.clumps.of(i);
  atoms.take_out(i);
  bed_.index.erase(tag);
  if (i < atoms.owned) bed_.index.set(atoms.tag[i], i);
  if (change.deleted) return;
  const int now = atoms.put_back(change.record, change.layout);
  if (bed_.scales.refills() && !change.moved) atoms.set_place(now, place);  // as it was packed when it woke
  atoms.mark_interface(now, false);
  if (clump) bed_.clumps.set_clump(now, clump);
  bed_.contacts.clear_histories(now);
  give(now, contacts);
  bed_.index.set(tag, now);
}

// ------------------------------------------------------------------------------------------------------------ by atom

void ShownBed::grow(int room) {
  if (shown_) names_.resize(static_cast<std::size_t>(room));
}

void ShownBed::copy(int from, int to) {
  if (shown_) names_[static_cast<std::size_t>(to)] = names_[static_cast<std::size_t>(from)];
}

void ShownBed::reset(int i) {
  if (shown_) names_[static_cast<std::size_t>(i)] = Name();
}

void ShownBed::pack(int i, double* to) const {
  if (!shown_) return;
  to[0] = names_[static_cast<std::size_t>(i)].home;
  to[1] = names_[static_cast<std::size_t>(i)].number;
}

void ShownBed::unpack(int i, const double* from) {
  if (shown_) names_[static_cast<std::size_t>(i)] = {static_cast<int>(from[0]), static_cast<std::int32_t>(from[1])};
}

}  // namespace solidcull
