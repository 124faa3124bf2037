#include "parts_that_came_off.h"

#include <algorithm>
#include <deque>
#include <limits>
#include <utility>

#include "flat_map.h"

namespace solidcull {
namespace {

class Searches {
 public:
  Searches(const std::vector<std::int64_t>& cut, const FrozenContacts& contacts,
           const std::function<bool(std::int64_t)>& is_member, const std::function<Vec3(std::int64_t)>& place)
      : cut_(cut), contacts_(contacts), is_member_(is_member), place_(place), searches_(cut.size()), growing_(cut.size()) {
    for (std::size_t s = 0; s < cut.size(); ++s) {
      searches_[s].queue.push_back({0, cut[s]});
      seen_[cut[s]] = static_cast<int>(s);
      turns_.push_back(static_cast<int>(s));
    }
  }

  std::vector<std::vector<std::int64_t>> run() {
    std::vector<std::vector<std::int64_t>> parts;
    const std::size_t wide = turns_in_width * cut_.size() + 64;  // turns before they make for each other
    for (std::size_t turn = 0; growing_ > 1; ++turn) {
      if (turn == wide) aim_all();
      const int mine = turns_.front();
      turns_.pop_front();
      if (searches_[mine].joined >= 0) continue;
      if (!searches_[mine].waits()) {
        --growing_;
        parts.push_back(std::move(searches_[mine].done));
        searches_[mine].closed = true;
        for (std::size_t s = 0; s < searches_.size() && growing_ > 1; ++s)
          if (searches_[s].aims && !searches_[s].closed && leader(searches_[s].goal) == mine) aim(static_cast<int>(s));
        continue;
      }
      // one granule a turn, so that the smallest part is the first that closes
      if (step(mine) == mine) turns_.push_back(mine);  // else the other's turn comes
    }
    return parts;
  }

 private:
  static constexpr std::size_t turns_in_width = 8;

  struct Waiting {
    double far;  // from the aim, squared
    std::int64_t tag;
    bool operator<(const Waiting& other) const { return far > other.far; }  // the nearest is a heap's greatest
  };
  struct Search {
    std::vector<std::int64_t> done;
    std::vector<Waiting> queue;
    std::size_t next = 0;  // of the queue; what comes before is done
    int joined = -1;
    bool aims = false, closed = false;  // aims: the queue is a heap
    int goal = 0;                       // cut place that it makes for
    Vec3 aim = Vec3::Zero();
    bool waits() const { return next < queue.size(); }
    std::size_t size() const { return done.size() + queue.size() - next; }
  };

  int leader(int s) const {
    while (searches_[s].joined >= 0) s = searches_[s].joined;
    return s;
  }

  /// Takes one granule; returns the search that it belongs to now.
  int step(int s) {
    const std::int64_t tag = take(searches_[s]);
    searches_[s].done.push_back(tag);
    contacts_.for_each_partner(tag, [&](std::int64_t partner) {
      if (!is_member_(partner)) return;
      if (const int* other = seen_.find(partner)) {
        const int o = leader(*other);
        if (o != s) s = join(s, o);
        return;
      }
      seen_[partner] = s;
      add(searches_[s], partner);
    });
    return s;
  }

  static std::int64_t take(Search& s) {
    if (!s.aims) return s.queue[s.next++].tag;
    std::pop_heap(s.queue.begin(), s.queue.end());
    const std::int64_t tag = s.queue.back().tag;
    s.queue.pop_back();
    return tag;
  }

  void add(Search& s, std::int64_t tag) const {
    if (!s.aims) {
      s.queue.push_back({0, tag});
      return;
    }
    s.queue.push_back({(place_(tag) - s.aim).squaredNorm(), tag});
    std::push_heap(s.queue.begin(), s.queue.end());
  }

  /// The smaller is added to the larger; returns that one.
  int join(int a, int b) {
    if (searches_[a].size() < searches_[b].size()) std::swap(a, b);
    Search &into = searches_[a], &from = searches_[b];
    into.done.insert(into.done.end(), from.done.begin(), from.done.end());
    for (std::size_t w = from.next; w < from.queue.size(); ++w) add(into, from.queue[w].tag);
    from = Search{};
    from.joined = a;
    --growing_;
    if (into.aims && growing_ > 1 && leader(into.goal) == a) aim(a);
    return a;
  }

  void aim_all() {
    places_.reserve(cut_.size());
    for (const std::int64_t tag : cut_) places_.push_back(place_(tag));
    for (std::size_t s = 0; s < searches_.size(); ++s)
      if (searches_[s].joined < 0 && !searches_[s].closed) aim(static_cast<int>(s));
  }

  /// Towards the cut place of another search that is nearest to where this one was going.
  void aim(int s) {
    Search& search = searches_[s];
    const Vec3 here = search.aims ? search.aim : places_[s];
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t c = 0; c < cut_.size(); ++c) {
      const int other = leader(static_cast<int>(c));
      if (other == s || searches_[other].closed) continue;
      const double far = (places_[c] - here).squaredNorm();
      if (far < nearest) {
        nearest = far;
        search.goal = static_cast<int>(c);
      }
    }
    search.aim = places_[search.goal];
    search.aims = true;
    search.queue.erase(search.queue.begin(), search.queue.begin() + static_cast<std::ptrdiff_t>(search.next));
    search.next = 0;
    for (Waiting& w : search.queue) w.far = (place_(w.tag) - search.aim).squaredNorm();
    std::make_heap(search.queue.begin(), search.queue.end());
  }

  const std::vector<std::int64_t>& cut_;
  const FrozenContacts& contacts_;
  const std::function<bool(std::int64_t)>& is_member_;
  const std::function<Vec3(std::int64_t)>& place_;
  std::vector<Search> searches_;
  std::vector<Vec3> places_;
  std::deque<int> turns_;
  FlatMap<int> seen_;
  std::size_t growing_;
};

}  // namespace

std::vector<std::vector<std::int64_t>> parts_that_came_off(const std::vector<std::int64_t>& cut, const FrozenContacts& contacts,
                                                           const std::function<bool(std::int64_t)>& is_member,
                                                           const std::function<Vec3(std::int64_t)>& place) {
  return Searches(cut, contacts, is_member, place).run();
}

}  // namespace solidcull
