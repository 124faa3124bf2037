#include "audit.h"

#include <algorithm>
#include <cmath>

namespace solidcull {
namespace {

/// A number that looks random and is the same on any number of ranks.
std::uint64_t lot_of(std::int64_t tag, std::int64_t step) {
  return scrambled(static_cast<std::uint64_t>(tag) + 0x9e3779b97f4a7c15ULL * static_cast<std::uint64_t>(step + 1));
}

}  // namespace

void Audit::stop() {
  survey_.watch(false);
  balls_.clear();
  woken_.clear();
  number_of_ = {};
  pairs_.clear();
  listed_ = false;
}

void Audit::begin_run() {
  if (!wanted()) return;
  stop();
  next_ = bed_.run.step + bed_.scales.settings().audit_every;
}

double Audit::reach() const { return std::min(patch_reach * bed_.scales.diameter(), bed_.scales.wake_up().largest_radius()); }

void Audit::see_look() {
  if (!wanted()) return;
  const std::int64_t step = bed_.run.step;
  if (runs() && step >= began_ + steps()) end();
  if (!runs() && step >= next_ && bed_.census.something_locked()) begin();
}

/// Of bodies that rest, what is near something awake: as many as are wanted, no two patches of which reach into each other.
std::vector<Audit::Centre> Audit::draw_centres() const {
  const Atoms& atoms = bed_.atoms;
  std::vector<char> near(static_cast<std::size_t>(atoms.owned), 0);
  bed_.contacts.neighbours().for_each_pair(atoms.owned, [&](int i, int j, int) {
    const bool first = atoms.is_interface(i), second = atoms.is_interface(j);
    if (first == second) return;
    if (first) near[i] = 1;
    if (second && j < atoms.owned) near[j] = 1;
  });
  std::vector<Centre> drawn;
  for (std::size_t k = 0; k < motion_.interface_atoms().size(); ++k) {
    const int i = motion_.interface_atoms()[k];
    if (near[i] && rests(motion_.active()[motion_.slot(k)], atoms.place(i)))
      drawn.push_back({lot_of(atoms.tag[i], bed_.run.step), triple(atoms.place(i)), atoms.tag[i]});
  }
  const auto by_lot = [](const Centre& a, const Centre& b) { return a.lot != b.lot ? a.lot < b.lot : a.tag < b.tag; };
  const std::size_t wanted = static_cast<std::size_t>(bed_.scales.settings().audit_patches), offered = 16 * wanted;
  std::sort(drawn.begin(), drawn.end(), by_lot);
  if (drawn.size() > offered) drawn.resize(offered);
  drawn = bed_.ranks.gather(drawn);
  std::sort(drawn.begin(), drawn.end(), by_lot);
  std::vector<Centre> chosen;
  const double apart = 2 * reach();
  for (const Centre& c : drawn) {
    const auto reaches = [&](const Centre& other) {
      return (bed_.solid.nearest_image(vec(c.at), vec(other.at)) - vec(other.at)).norm() < apart;
    };
    if (chosen.size() < wanted && std::none_of(chosen.begin(), chosen.end(), reaches)) chosen.push_back(c);
  }
  return chosen;
}

void Audit::begin() {
  next_ = bed_.run.step + bed_.scales.settings().audit_every;
  began_ = bed_.run.step;
  for (const Centre& c : draw_centres()) {
    balls_.push_back({vec(c.at), reach(), Woke::audit});
    if (bed_.ranks.owns(balls_.back().centre)) bed_.wake.ask(balls_.back().centre, balls_.back().radius, Woke::audit);
  }
  if (runs()) survey_.watch(true);
}

/// No part of it there is faster than solid state may be.
bool Audit::rests(const ActiveBody& b, const Vec3& there) const {
  return b.stands || b.body->twist.at(there).norm() < bed_.scales.solid_state().speed;
}

/// Beside what its body would have carried it along (m).
double Audit::way(const Woken& w) const {
  const Vec3 from = survey_[w.atom].woke_at;
  const double seconds = static_cast<double>(bed_.run.step - began_) * bed_.run.dt;
  return (bed_.solid.nearest_image(bed_.atoms.place(w.atom), from) - from - seconds * w.carried).norm();
}

/// In the first step after they have woken, before anything has moved.
void Audit::meet_woken() {
  const Atoms& atoms = bed_.atoms;
  std::vector<std::int64_t> tags;
  for (int i = 0; i < atoms.owned; ++i) {
    if (!survey_.is_watched(i)) continue;
    const Vec3 x = atoms.place(i);
    const auto ball = std::find_if(balls_.begin(), balls_.end(),
                                   [&](const Ball& b) { return b.holds(bed_.solid.nearest_image(x, b.centre), bed_.run.skin); });
    if (ball == balls_.end()) continue;
    Woken w{};
    w.tag = atoms.tag[i];
    w.patch = static_cast<int>(ball - balls_.begin());
    w.deep = bed_.shell[i].came_back > began_;
    w.carried = atoms.velocity(i);
    tags.push_back(w.tag);
    woken_.push_back(w);
  }
  for (const std::int64_t tag : bed_.ranks.gather(tags)) number_of_[tag] = none;
  for (std::size_t n = 0; n < woken_.size(); ++n) number_of_[woken_[n].tag] = static_cast<std::ptrdiff_t>(n);
  list_pairs();
  const WakeUpLaw& law = bed_.scales.wake_up();
  const std::vector<Vec3> felt_now = felt();
  const std::vector<double> load = pressing();
  for (std::size_t n = 0; n < woken_.size(); ++n) {
    woken_[n].felt_then = felt_now[n];
    woken_[n].load = load[n];
    woken_[n].tolerance = law.tolerance(atoms.mass[woken_[n].atom], woken_[n].load);
  }
}

/// Those that have gone to another rank, or are no more, have no atom here.
void Audit::list_pairs() {
  listed_ = true;
  pairs_.clear();
  for (Woken& w : woken_) w.atom = -1;
  const Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned; ++i)
    if (survey_.is_watched(i))
      if (const std::ptrdiff_t* n = number_of_.find(atoms.tag[i]); n && *n != none) woken_[static_cast<std::size_t>(*n)].atom = i;
  const auto number = [&](int i) {
    const std::ptrdiff_t* n = i < atoms.owned && survey_.is_watched(i) ? number_of_.find(atoms.tag[i]) : nullptr;
    return n ? *n : none;
  };
  bed_.contacts.neighbours().for_each_pair(atoms.owned, [&](int i, int j, int k) {
    const Pair p{i, k, j, number(i), number(j)};
    if (p.one != none || p.other != none) pairs_.push_back(p);
  });
}

/// What the contacts of each of woken_ press with (N).
std::vector<double> Audit::pressing() const {
  const Atoms& atoms = bed_.atoms;
  std::vector<double> load(woken_.size(), 0.0);
  for (const Pair& p : pairs_) {
    const Vec3 apart = atoms.place(p.i) - atoms.place(p.j);
    if (apart.norm() > (atoms.radius[p.i] + atoms.radius[p.j]) * bed_.contacts.reach_factor) continue;
    const double n = std::abs(bed_.contacts.force_on_first(p.i, p.k).dot(apart)) / apart.norm();
    for (const std::ptrdiff_t end : {p.one, p.other})
      if (end != none) load[static_cast<std::size_t>(end)] += n;
  }
  return load;
}

/// By each of woken_, from what is awake without the audit: other granules, and walls that move (N).
std::vector<Vec3> Audit::felt() const {
  const Atoms& atoms = bed_.atoms;
  std::vector<Vec3> felt(woken_.size(), Vec3::Zero()), all = felt;
  const auto is_awake = [&](int atom) {
    if (atoms.is_interface(atom)) return false;
    const std::ptrdiff_t* n = number_of_.find(atoms.tag[atom]);
    return !n || (*n != none && woken_[static_cast<std::size_t>(*n)].ended);
  };
  for (const Pair& p : pairs_) {
    if ((atoms.place(p.i) - atoms.place(p.j)).norm() > (atoms.radius[p.i] + atoms.radius[p.j]) * bed_.contacts.reach_factor)
      continue;
    const Vec3 f = bed_.contacts.force_on_first(p.i, p.k);
    if (p.one != none) {
      all[static_cast<std::size_t>(p.one)] += f;
      if (is_awake(p.j)) felt[static_cast<std::size_t>(p.one)] += f;
    }
    if (p.other != none) {
      all[static_cast<std::size_t>(p.other)] -= f;
      if (is_awake(p.i)) felt[static_cast<std::size_t>(p.other)] -= f;
    }
  }
  for (std::size_t n = 0; n < woken_.size(); ++n) {
    const int i = woken_[n].atom;
    if (i < 0 || walls_[i].touched == 0 || walls_[i].stands) continue;
    felt[n] += atoms.force(i) - all[n] - atoms.mass[i] * bed_.run.gravity();
  }
  return felt;
}

void Audit::see_forces() {
  if (!runs()) return;
  if (bed_.run.step == began_ + 1) return meet_woken();
  if (!listed_) list_pairs();
  const std::vector<Vec3> now = felt();
  std::vector<Ball> waking;
  for (std::size_t n = 0; n < woken_.size(); ++n) {
    const Woken& w = woken_[n];
    if (w.ended || w.atom < 0) continue;
    const double excess = (now[n] - w.felt_then).norm() / w.tolerance;
    if (excess > 1) waking.push_back({bed_.atoms.place(w.atom), bed_.scales.wake_up().radius(excess), Woke::load});
  }
  end_around(waking);
}

/// What they hold would have woken without the audit. What it presses its neighbours with now is no change for them.
void Audit::end_around(const std::vector<Ball>& balls) {
  std::vector<std::size_t> ending;
  for (std::size_t n = 0; n < woken_.size(); ++n) {
    if (woken_[n].ended || woken_[n].atom < 0) continue;
    const Vec3 x = bed_.atoms.place(woken_[n].atom);
    if (std::any_of(balls.begin(), balls.end(), [&](const Ball& b) { return b.holds(bed_.solid.nearest_image(x, b.centre), 0); }))
      ending.push_back(n);
  }
  if (ending.empty()) return;
  const std::vector<Vec3> before = felt();
  const std::vector<double> load = pressing();
  for (const std::size_t n : ending) {
    take_leave(woken_[n], load[n]);
    woken_[n].ended = true;
  }
  const std::vector<Vec3> after = felt();
  for (std::size_t n = 0; n < woken_.size(); ++n) woken_[n].felt_then += after[n] - before[n];
}

/// What it has done until now; its contacts press with `load`.
void Audit::take_leave(Woken& w, double load) const {
  w.did.granules = 1;
  w.did.moved = way(w);
  w.did.energy = 0.5 * bed_.atoms.mass[w.atom] * (bed_.atoms.velocity(w.atom) - w.carried).squaredNorm();
  if (!w.deep || walls_[w.atom].touched > 0) return;  // what walls press with is not known of both times
  w.did.deep = 1;
  w.did.load = w.load;
  w.did.load_shift = std::abs(load - w.load);
}

void Audit::see_wakes(const Wakes& wakes) {
  if (!runs() || bed_.run.step <= began_ + 1) return;
  if (wakes.wakes_all()) return stop();
  end_around(wakes.balls);
}

void Audit::end() {
  list_pairs();
  const std::vector<double> load = pressing();
  std::vector<AuditedPatch> patches(balls_.size());
  for (std::size_t n = 0; n < woken_.size(); ++n) {
    Woken& w = woken_[n];
    if (!w.ended && w.atom >= 0) take_leave(w, load[n]);
    w.did.ended = w.ended;
    patches[static_cast<std::size_t>(w.patch)].add(w.did);
  }
  const std::vector<AuditedPatch> of_ranks = bed_.ranks.gather(patches);
  std::vector<AuditedPatch> whole(patches.size());
  for (std::size_t k = 0; k < of_ranks.size(); ++k) whole[k % whole.size()].add(of_ranks[k]);
  tally_.add(whole);
  stop();
}

}  // namespace solidcull
