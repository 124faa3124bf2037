#include "solid_bodies.h"

#include <algorithm>
#include <deque>
#include <utility>

namespace solidcull {

void MassProperties::add(double m, const Vec3& x, double r, int sign) {
  count += sign;
  mass += sign * m;
  first += sign * m * x;
  second += sign * m * x * x.transpose();
  spin += sign * 0.4 * m * r * r;
}

void MassProperties::add(const MassProperties& other, int sign) {
  count += sign * other.count;
  mass += sign * other.mass;
  first += sign * other.first;
  second += sign * other.second;
  spin += sign * other.spin;
}

Eigen::Matrix3d MassProperties::inertia() const {
  const Vec3 c = centre();
  const Eigen::Matrix3d about_centre = second - mass * c * c.transpose();
  return (about_centre.trace() + spin) * Eigen::Matrix3d::Identity() - about_centre;
}

int SolidBodies::root(int body) const {
  while (parent_[body] != body) body = parent_[body] = parent_[parent_[body]];
  return body;
}

int SolidBodies::body_of(std::int64_t tag) const {
  const int* body = member_.find(tag);
  return body ? root(*body) : 0;
}

int SolidBodies::merge(int a, int b) {
  if (a == b) return a;
  // the larger body keeps its number, so that colours in pictures stay
  if (bodies_[a].count < bodies_[b].count || (bodies_[a].count == bodies_[b].count && a > b)) std::swap(a, b);
  bodies_[a].add(bodies_[b]);
  bodies_.erase(b);
  parent_[b] = a;
  merges_.emplace_back(a, b);
  return a;
}

void SolidBodies::lock(std::int64_t tag, const GranuleMass& granule, const FrozenContacts& contacts) {
  int body = 0;
  contacts.for_each_partner(tag, [&](std::int64_t partner) {
    const int theirs = body_of(partner);
    if (theirs) body = body ? merge(body, theirs) : theirs;
  });
  if (!body) {
    body = static_cast<int>(parent_.size());
    parent_.push_back(body);
  }
  member_[tag] = body;
  bodies_[body].add(granule.mass, granule.position, granule.radius);
}

void SolidBodies::unlock(std::int64_t tag, const GranuleMass& granule, const FrozenContacts& contacts) {
  const int body = body_of(tag);
  if (!body) return;
  member_.erase(tag);
  MassProperties& p = bodies_[body];
  p.add(granule.mass, granule.position, granule.radius, -1);
  if (p.count == 0) bodies_.erase(body);
  contacts.for_each_partner(tag, [&](std::int64_t partner) { cut_.push_back(partner); });
}

std::vector<int> SolidBodies::split(const FrozenContacts& contacts, const MassOf& mass_of) {
  struct Search {
    std::vector<std::int64_t> reached;
    std::size_t next = 0;
    int joined = -1;
  };
  std::map<int, std::vector<std::int64_t>> sources;
  for (const std::int64_t tag : cut_)
    if (const int body = body_of(tag)) sources[body].push_back(tag);
  cut_.clear();

  split_parents_.clear();
  std::vector<int> born;
  for (auto& [body, tags] : sources) {
    std::sort(tags.begin(), tags.end());
    tags.erase(std::unique(tags.begin(), tags.end()), tags.end());
    std::vector<Search> searches(tags.size());
    FlatMap<int> seen;
    for (std::size_t s = 0; s < tags.size(); ++s) {
      searches[s].reached.push_back(tags[s]);
      seen[tags[s]] = static_cast<int>(s);
    }
    const auto leader = [&](int s) {
      while (searches[s].joined >= 0) s = searches[s].joined;
      return s;
    };
    std::deque<int> turns;
    for (std::size_t s = 0; s < tags.size(); ++s) turns.push_back(static_cast<int>(s));
    std::size_t growing = tags.size();
    while (growing > 1) {
      const int s = turns.front();
      turns.pop_front();
      if (searches[s].joined >= 0) continue;
      Search& mine = searches[s];
      if (mine.next < mine.reached.size()) {
        const std::int64_t tag = mine.reached[mine.next++];
        contacts.for_each_partner(tag, [&](std::int64_t partner) {
          if (!member_.contains(partner)) return;
          if (const int* other = seen.find(partner)) {
            const int o = leader(*other);
            if (o == s) return;
            Search& theirs = searches[o];
            // keep one queue: what is reached and done first, what is reached and waits last
            std::vector<std::int64_t> both(mine.reached.begin(), mine.reached.begin() + static_cast<std::ptrdiff_t>(mine.next));
            both.insert(both.end(), theirs.reached.begin(), theirs.reached.begin() + static_cast<std::ptrdiff_t>(theirs.next));
            const std::size_t done = both.size();
            both.insert(both.end(), mine.reached.begin() + static_cast<std::ptrdiff_t>(mine.next), mine.reached.end());
            both.insert(both.end(), theirs.reached.begin() + static_cast<std::ptrdiff_t>(theirs.next), theirs.reached.end());
            mine.reached = std::move(both);
            mine.next = done;
            theirs = Search{};
            theirs.joined = s;
            --growing;
            return;
          }
          seen[partner] = s;
          mine.reached.push_back(partner);
        });
        turns.push_back(s);
        continue;
      }
      // this part is closed and others are still growing: it has come off
      --growing;
      const int fresh = static_cast<int>(parent_.size());
      parent_.push_back(fresh);
      MassProperties part;
      for (const std::int64_t tag : mine.reached) {
        member_[tag] = fresh;
        const GranuleMass g = mass_of(tag);
        part.add(g.mass, g.position, g.radius);
      }
      bodies_[body].add(part, -1);
      bodies_[fresh] = part;
      born.push_back(fresh);
      split_parents_.push_back(body);
    }
  }
  return born;
}

std::vector<std::pair<int, int>> SolidBodies::take_merges() { return std::exchange(merges_, {}); }

}  // namespace solidcull
