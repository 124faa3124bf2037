#include "body_groups.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>

#include "release.h"

namespace solidcull {

auto BodyGroups::key_of(int body) const -> Key {
  const int place = spanning(body);
  return place < 0 ? trees_.own_key(body) : trees_.parts()[static_cast<std::size_t>(place)].key;
}

auto BodyGroups::key_of_atom(int i) const -> Key {
  if (i < bed_.atoms.owned) return bed_.shell[i].locked ? key_of(bed_.shell[i].body) : 0;
  const Key* key = ghost_key_.find(bed_.atoms.tag[i]);
  return key ? *key : 0;
}

/// A contact across ranks ties the bodies of its two ends: each rank shows its end to its neighbours.
void BodyGroups::group() {
  bed_.solid.tell_settled();
  trees_.clear();
  if (bed_.ranks.count == 1) return;
  struct End {
    Triple at;     // in the box
    Triple place;  // in the image of its body
    std::int64_t low, high;
    int rank, body;
  };
  std::vector<End> ends;
  const SolidBodies& bodies = bed_.solid.bodies();
  // two stored granules of which one is elsewhere have their contact in the graph, too
  bed_.solid.review_contacts([&](std::int64_t low, std::int64_t high) {
    const int of_low = bodies.body_of(low), of_high = bodies.body_of(high);
    if (of_low && of_high) return false;
    if (!of_low && !of_high) return true;
    const int body = of_low ? of_low : of_high;
    const Vec3 x = bodies.pose(body).to_world(masses_(of_low ? low : high).position);
    ends.push_back({triple(bed_.run.wrapped(x)), triple(x), low, high, bed_.ranks.me, body});
    return true;
  });

  std::map<std::pair<std::int64_t, std::int64_t>, const End*> own;
  for (const End& e : ends) own[{e.low, e.high}] = &e;
  // granules may be a skin outside of their subdomain, stored ones what they may lag behind
  const double reach = contact_reach(bed_) + bed_.run.skin + stored_.slack();
  struct Met {
    const End* own;
    End other;
  };
  std::vector<Met> met;
  for (const End& other : bed_.ranks.exchange(ends, reach)) {
    const auto one = own.find({other.low, other.high});
    if (one != own.end() && other.rank != bed_.ranks.me) met.push_back({one->second, other});
  }
  // by contact, so that both ranks take the same one of several to be the first
  std::sort(met.begin(), met.end(),
            [](const Met& a, const Met& b) { return std::tie(a.own->low, a.own->high) < std::tie(b.own->low, b.own->high); });
  const Vec3 edges = bed_.solid.bodies().periods();
  std::map<int, std::vector<PartLink>> links;
  for (const Met& m : met) {
    const Vec3 x = vec(m.own->place), y = vec(m.other.place);
    Vec3 to_other = bed_.solid.nearest_image(x, y) - x;
    for (int d = 0; d < 3; ++d) to_other[d] = edges[d] > 0 ? edges[d] * std::round(to_other[d] / edges[d]) : 0;
    std::vector<PartLink>& of_body = links[m.own->body];
    const auto known = std::find_if(of_body.begin(), of_body.end(),
                                    [&](const PartLink& l) { return l.rank == m.other.rank && l.body == m.other.body; });
    if (known == of_body.end()) {
      of_body.push_back({m.other.rank, m.other.body, to_other, {}});
      continue;
    }
    for (int d = 0; d < 3; ++d)
      known->tied_anew[d] = known->tied_anew[d] || std::abs(to_other[d] - known->to_other[d]) > 0.5 * edges[d];
  }
  tell_links(links, bed_.ranks.neighbours(reach));
  trees_.grow(links, edges);
}

/// What goes to another site may be farther from what it touched than any contact reaches. So a rank may see the other's end of a
/// contact while its own is out of the other's sight: what one of the two ranks knows both know then.
void BodyGroups::tell_links(std::map<int, std::vector<PartLink>>& links, const std::vector<int>& ranks) const {
  struct Row {
    int from, to;  // bodies, by their numbers on the ranks that send and receive
    Triple to_other;
    std::array<bool, 3> tied_anew;
  };
  std::map<int, std::vector<Row>> out;  // by rank
  for (const auto& [body, of_body] : links)
    for (const PartLink& l : of_body) out[l.rank].push_back({body, l.body, triple(l.to_other), l.tied_anew});
  for (const int rank : ranks) bed_.ranks.send_rows(rank, out[rank]);
  for (const int rank : ranks)
    for (const Row& r : bed_.ranks.receive_rows<Row>(rank)) {
      std::vector<PartLink>& of_body = links[r.to];
      if (std::none_of(of_body.begin(), of_body.end(), [&](const PartLink& l) { return l.rank == rank && l.body == r.from; }))
        of_body.push_back({rank, r.from, -vec(r.to_other), r.tied_anew});
    }
}

void BodyGroups::settle_those_here() {
  for (auto& [number, body] : bed_.solid.bodies_in_motion()) {
    const bool spans_ranks = spans(number);
    // what was a part of a larger body may have become a body of its own without a change of its granules
    body.note_span(spans_ranks);
    if (body.grounded && !spans_ranks && body.mass.held == 0) bed_.solid.ground(number, false);  // what held it has gone
    if (!spans_ranks && body.changed) body.settle();
  }
}

template <class TakesPart>
void BodyGroups::settle_those_over_ranks(TakesPart takes_part) {
  struct Part {
    double mass, grounded_mass, felt_mass;  // the last: of parts that know what gravity they felt when they were locked
    Triple felt;                            // sum of that times their masses, world frame
    Triple centre, momentum, angular_momentum;
    std::array<double, 9> inertia;
    std::array<bool, 3> tied;
    bool grounded, held;  // some part is
    RigidSum sum() const {
      return {mass, vec(centre), Eigen::Map<const Eigen::Matrix3d>(inertia.data()), vec(momentum), vec(angular_momentum)};
    }
    void set(const RigidSum& s) {
      mass = s.mass;
      centre = triple(s.centre);
      momentum = triple(s.momentum);
      angular_momentum = triple(s.angular_momentum);
      std::copy_n(s.inertia.data(), 9, inertia.begin());
    }
  };
  std::vector<Part> parts(trees_.parts().size(), Part{});
  for (std::size_t at = 0; at < parts.size(); ++at) {
    const SolidBody* const body = part(at);
    if (!body || !takes_part(static_cast<int>(at))) continue;
    const RankTrees::Part& p = trees_.parts()[at];
    RigidSum sum(body->part());
    sum.centre += p.shift;
    Part& row = parts[at];
    row.set(sum);
    row.grounded_mass = body->grounded_mass;
    row.felt_mass = body->felt_known ? body->mass.mass : 0.0;
    row.felt = triple(row.felt_mass * body->pose.turned_to_world(body->felt));
    for (int d = 0; d < 3; ++d) row.tied[d] = body->spans[d] || p.tied[d];
    row.grounded = body->grounded;
    row.held = body->mass.held != 0;
  }
  trees_.unite(
      parts,
      [](Part& whole, const Part& other) {
        if (whole.mass == 0) {
          whole.set(other.sum());
        } else if (other.mass != 0) {
          RigidSum sum = whole.sum();
          sum.add(other.sum());
          whole.set(sum);
        }
        whole.grounded_mass += other.grounded_mass;
        whole.felt_mass += other.felt_mass;
        for (int d = 0; d < 3; ++d) whole.felt[d] += other.felt[d];
        for (int d = 0; d < 3; ++d) whole.tied[d] = whole.tied[d] || other.tied[d];
        whole.grounded = whole.grounded || other.grounded;
        whole.held = whole.held || other.held;
      },
      takes_part);
  for (std::size_t p = 0; p < parts.size(); ++p) {
    if (!takes_part(static_cast<int>(p)) || !part(p)) continue;
    const Part& whole = parts[p];
    if (whole.mass == 0) continue;  // spheres of clumps whose mass has been lost
    const int number = trees_.parts()[p].body;
    bed_.solid.ground(number, whole.grounded && whole.held);
    SolidBody& body = bed_.solid.body(number);
    if (whole.felt_mass > 0) body.feel(body.pose.turned_to_frame(vec(whole.felt) / whole.felt_mass));
    body.settle_as_part(whole.sum(), SolidBody::free_axes(whole.tied), trees_.parts()[p].shift, whole.grounded_mass / whole.mass);
  }
}

void BodyGroups::settle() {
  group();
  settle_those_here();
  settle_those_over_ranks([](int) { return true; });
}

void BodyGroups::settle_grounded(bool changed, const std::vector<char>& over_ranks) {
  if (changed) {
    bed_.solid.tell_settled();
    settle_those_here();
  }
  settle_those_over_ranks([&](int place) { return over_ranks[static_cast<std::size_t>(place)] != 0; });
}

void BodyGroups::share() {
  ghost_key_.clear();
  if (!bed_.ranks.has_neighbours()) return;
  struct Row {
    Triple at;
    std::int64_t tag;
    Key key;
  };
  std::vector<Row> rows;
  const Atoms& atoms = bed_.atoms;
  for (int i = 0; i < atoms.owned; ++i)
    if (bed_.shell[i].locked) rows.push_back({triple(atoms.place(i)), atoms.tag[i], key_of(bed_.shell[i].body)});
  for (const Row& r : bed_.ranks.exchange(rows, contact_reach(bed_))) ghost_key_[r.tag] = r.key;
}

void BodyGroups::release_memory() { release(ghost_key_); }

}  // namespace solidcull
