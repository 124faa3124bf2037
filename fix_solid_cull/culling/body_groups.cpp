#include "body_groups.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "release.h"

namespace solidcull {

int BodyGroups::key_of(int body) const {
  const auto group = groups_.find(body);
  return group == groups_.end() ? body * bed_.ranks.count + bed_.ranks.me : group->second.key;
}

bool BodyGroups::has_key_of_first_part(int body) const { return key_of(body) == body * bed_.ranks.count + bed_.ranks.me; }

int BodyGroups::key_of_atom(int i) const {
  if (i < bed_.atoms.owned) return bed_.shell[i].locked ? key_of(bed_.shell[i].body) : 0;
  const int* key = ghost_key_.find(bed_.atoms.tag[i]);
  return key ? *key : 0;
}

int BodyGroups::spanning(int body) const {
  const auto group = groups_.find(body);
  if (group == groups_.end()) return -1;
  const auto at = std::lower_bound(spanning_.begin(), spanning_.end(), group->second.key);
  return at != spanning_.end() && *at == group->second.key ? static_cast<int>(at - spanning_.begin()) : -1;
}

/// Stored granules that may touch one of another rank.
std::vector<std::int64_t> BodyGroups::stored_at_borders() const {
  std::vector<std::int64_t> tags;
  const Run& run = bed_.run;
  const double reach = 2 * bed_.solid.store().largest_radius() + run.skin + stored_.slack();
  const Vec3 edges = run.edges();
  const Vec3 out = Vec3::Constant(reach + edges[0] + edges[1] + edges[2]);
  for (int d = 0; d < 3; ++d)
    for (const bool upper : {false, true}) {
      Vec3 from = run.own.lo - out, to = run.own.hi + out;
      (upper ? from : to)[d] = upper ? run.own.hi[d] - reach : run.own.lo[d] + reach;
      stored_.for_each_in_box(from, to, [&](const Resident& g) { tags.push_back(g.tag); });
    }
  std::sort(tags.begin(), tags.end());
  tags.erase(std::unique(tags.begin(), tags.end()), tags.end());
  return tags;
}

void BodyGroups::group() {
  bed_.solid.tell_settled();
  groups_.clear();
  spanning_.clear();
  tied_.clear();
  if (bed_.ranks.count == 1) return;
  // a contact across ranks joins the bodies of its two ends: each rank sends its end, all ranks join the same pairs
  struct End {
    std::int64_t low, high;
    int body;  // as a key before groups are known
    Triple place;
  };
  std::vector<End> ends;
  const SolidBodies& bodies = bed_.solid.bodies();
  const int ranks = bed_.ranks.count, me = bed_.ranks.me;
  const auto reaches_out = [&](std::int64_t tag) {
    const int body = bodies.body_of(tag);
    if (!body) return;
    bed_.solid.contacts().for_each_partner(tag, [&](std::int64_t partner) {
      if (bodies.body_of(partner)) return;
      const Vec3 x = bodies.pose(body).to_world(masses_(tag).position);
      ends.push_back({std::min(tag, partner), std::max(tag, partner), body * ranks + me, triple(x)});
    });
  };
  for (int i = 0; i < bed_.atoms.owned; ++i)
    if (bed_.shell[i].locked) reaches_out(bed_.atoms.tag[i]);
  for (const std::int64_t tag : stored_at_borders()) reaches_out(tag);
  bed_.arrivals.for_each_tag(reaches_out);
  ends = bed_.ranks.gather(ends);
  struct Link {
    int parent;
    Vec3 shift;  // this one's image + shift = the parent's image
  };
  std::map<int, Link> links;
  const auto root = [&](int key) {
    Link l{key, Vec3::Zero()};
    for (auto at = links.find(l.parent); at != links.end(); at = links.find(l.parent)) {
      if (at->second.parent == l.parent) break;
      l.shift += at->second.shift;
      l.parent = at->second.parent;
    }
    return l;
  };
  const Vec3 edges = bed_.run.edges();
  std::map<std::pair<std::int64_t, std::int64_t>, std::size_t> first_end;
  std::set<int> joined;
  for (std::size_t r = 0; r < ends.size(); ++r) {
    const auto end = first_end.emplace(std::make_pair(ends[r].low, ends[r].high), r);
    if (end.second) continue;
    const End &one = ends[end.first->second], &other = ends[r];
    const Link a = root(one.body), b = root(other.body);
    joined.insert({one.body, other.body});
    const Vec3 xa = vec(one.place), xb = vec(other.place);
    Vec3 to_a = bed_.solid.nearest_image(xb, xa) - xb;  // image of b + to_a = image of a, at this contact
    for (int d = 0; d < 3; ++d) to_a[d] = edges[d] > 0 ? edges[d] * std::round(to_a[d] / edges[d]) : 0;
    const Vec3 shift = to_a + a.shift - b.shift;
    if (a.parent == b.parent) {
      for (int d = 0; d < 3; ++d)
        if (std::abs(shift[d]) > 0.5 * edges[d]) tied_[a.parent][d] = true;
    } else if (a.parent < b.parent) {
      links[b.parent] = {a.parent, shift};
    } else {
      links[a.parent] = {b.parent, -shift};
    }
  }
  std::map<int, std::array<bool, 3>> tied;
  for (const auto& s : tied_)
    for (int d = 0; d < 3; ++d) tied[root(s.first).parent][d] |= s.second[d];
  tied_ = tied;
  for (const int key : joined) spanning_.push_back(root(key).parent);
  std::sort(spanning_.begin(), spanning_.end());
  spanning_.erase(std::unique(spanning_.begin(), spanning_.end()), spanning_.end());
  for (const auto& body : bodies.bodies()) {
    const Link l = root(body.first * ranks + me);
    groups_[body.first] = {l.parent, l.shift};
  }
}

void BodyGroups::settle() {
  group();
  for (auto& [number, body] : bed_.solid.bodies_in_motion()) {
    const bool spans_ranks = spans(number);
    // what was a part of a larger body may have become a body of its own without a change of its granules
    body.note_span(spans_ranks);
    if (body.grounded && !spans_ranks && body.mass.held == 0) bed_.solid.ground(number, false);  // what held it has gone
    if (!spans_ranks && body.changed) body.settle();
  }
  if (spanning_.empty()) return;
  struct Part {
    int key;
    double mass;
    Triple centre;
    std::array<double, 9> inertia;
    Triple velocity, spin;
    std::array<bool, 3> tied;
    bool grounded, held;
    double grounded_mass;
  };
  std::vector<Part> mine;
  for (const auto& [number, body] : bed_.solid.bodies().bodies()) {
    if (!spans(number)) continue;
    const Group& group = groups_.at(number);
    const RigidPart p = body.part();
    Part row{group.key,
             p.mass,
             triple(p.centre + group.shift),
             {},
             triple(p.velocity),
             triple(p.spin),
             body.spans,
             body.grounded,
             body.mass.held != 0,
             body.grounded_mass};
    std::copy_n(p.inertia.data(), 9, row.inertia.begin());
    mine.push_back(row);
  }
  struct Whole {
    std::vector<RigidPart> parts;
    bool grounded = false, held = false;  // some part is
    double grounded_of_itself = 0, mass = 0;
  };
  std::map<int, Whole> wholes;
  for (const Part& row : bed_.ranks.gather(mine)) {
    Whole& whole = wholes[row.key];
    RigidPart p;
    p.mass = row.mass;
    p.centre = vec(row.centre);
    p.inertia = Eigen::Map<const Eigen::Matrix3d>(row.inertia.data());
    p.velocity = vec(row.velocity);
    p.spin = vec(row.spin);
    whole.parts.push_back(p);
    whole.grounded |= row.grounded;
    whole.held |= row.held;
    whole.grounded_of_itself += row.grounded_mass;
    whole.mass += row.mass;
    for (int d = 0; d < 3; ++d) tied_[row.key][d] |= row.tied[d];
  }
  for (auto& [number, body] : bed_.solid.bodies_in_motion()) {
    const Group& group = groups_.at(number);
    const auto found = wholes.find(group.key);
    if (found == wholes.end()) continue;
    const Whole& whole = found->second;
    bed_.solid.ground(number, whole.grounded && whole.held);
    body.settle_as_part(whole.parts, SolidBody::free_axes(tied_.at(group.key)), group.shift,
                        whole.grounded_of_itself / whole.mass);
  }
}

void BodyGroups::share() {
  ghost_key_.clear();
  if (!bed_.ranks.has_neighbours()) return;
  struct Row {
    Triple at;
    std::int64_t tag;
    int key;
  };
  std::vector<Row> rows;
  const Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned; ++i)
    if (bed_.shell[i].locked) rows.push_back({triple(atoms.place(i)), atoms.tag[i], key_of(bed_.shell[i].body)});
  for (const Row& r : bed_.ranks.exchange(rows, contact_reach(bed_))) ghost_key_[r.tag] = r.key;
}

void BodyGroups::release_memory() { release(ghost_key_); }

}  // namespace solidcull
