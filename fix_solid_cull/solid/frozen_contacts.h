// Contacts between two locked granules of which at least one is an atom. The engine excludes such pairs from its lists; their
// histories wait here, each once. Those of two stored granules are in InnerContacts.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <utility>
#include <vector>

#include "chunked_array.h"
#include "flat_map.h"
#include "sphere.h"

namespace solidcull {

/// An undirected graph: nodes are granule tags, edges are contacts with a history of `width` numbers (may be 0).
/// A history has a sense: component d changes its sign with the side it is seen from where flips[d] is true.
/// Tags are the engine's ints (else std::logic_error). Local to the rank; a contact across ranks stands in the graph of either
/// rank. Memory: 16 bytes per edge, 8 width() for its history, 13 per node.
/// Contacts that are known from elsewhere, without history, are listed with a granule's own and stand nowhere else: add(),
/// contains(), drop(), erase(), for_each_contact() and size() know the graph's own edges only.
class FrozenContacts {
 public:
  /// flips: one entry per history component, true for vector-like ones (the engine's "newton" flag of that component).
  void set_layout(std::vector<bool> flips);
  const std::vector<bool>& layout() const { return flips_; }
  std::size_t width() const { return flips_.size(); }

  /// Adds to `partners` those of `tag` that are known from elsewhere; they must not stand in the graph too.
  using Elsewhere = std::function<void(std::int64_t tag, std::vector<std::int64_t>& partners)>;
  void set_elsewhere(Elsewhere contacts) { elsewhere_ = std::move(contacts); }

  /// Adds the contact of `tag` with `partner`, history as `tag` sees it (`width()` numbers, or nullptr: touching without
  /// history). A contact that is there already keeps its place and takes the new history.
  void add(std::int64_t tag, std::int64_t partner, const double* history);

  /// The same for a contact that is not there yet, whose history is still that in the world: it has none until
  /// turn_all_unturned(), before which nothing may be removed.
  void add_unturned(std::int64_t tag, std::int64_t partner, const double* history);
  /// into_body(low tag, high tag): the rotation from the world to the frame in which the contact's history waits.
  template <class IntoBody>
  void turn_all_unturned(IntoBody into_body) {
    for (const std::uint32_t e : unturned_) {
      turn(histories_.row(e), into_body(edges_[e].low, edges_[e].high));
      edges_[e].has_history = true;
    }
    unturned_ = std::vector<std::uint32_t>();
  }

  /// Before that, every contact once: visit(low tag, high tag, history in the world as the low tag sees it or nullptr).
  template <class Visit>
  void for_each_contact_in_world(Visit visit) const {
    std::vector<bool> waits(edges_.size());
    for (const std::uint32_t e : unturned_) waits[e] = true;
    for (std::uint32_t e = 0; e < edges_.size(); ++e)
      if (edges_[e].low != edges_[e].high) visit(edges_[e].low, edges_[e].high, waits[e] ? histories_.row(e) : nullptr);
  }

  /// Calls visit(partner, history as `tag` sees it or nullptr) for each contact of `tag`.
  template <class Visit>
  void for_each(std::int64_t tag, Visit visit) const {
    for_each_here(tag, visit);
    if (elsewhere_) for_each_elsewhere(tag, [&](std::int64_t partner) { visit(partner, nullptr); });
  }
  /// Those of them that stand in the graph.
  template <class Visit>
  void for_each_here(std::int64_t tag, Visit visit) const {
    Seen seen(width());
    for (std::uint32_t e = first(tag); e != none; e = next(e, tag)) visit(other(e, tag), read(e, tag, seen.data()));
  }
  /// Partners only; cheaper.
  template <class Visit>
  void for_each_partner(std::int64_t tag, Visit visit) const {
    for_each_partner_here(tag, visit);
    if (elsewhere_) for_each_elsewhere(tag, visit);
  }
  /// Those of them whose contacts stand in the graph.
  template <class Visit>
  void for_each_partner_here(std::int64_t tag, Visit visit) const {
    for (std::uint32_t e = first(tag); e != none; e = next(e, tag)) visit(other(e, tag));
  }
  /// Those of them that are known from elsewhere.
  template <class Visit>
  void for_each_elsewhere(std::int64_t tag, Visit visit) const {
    if (!elsewhere_) return;
    std::vector<std::int64_t> partners;
    elsewhere_(tag, partners);
    for (const std::int64_t partner : partners) visit(partner);
  }
  /// Every contact once: visit(low tag, high tag, history as the low tag sees it or nullptr).
  template <class Visit>
  void for_each_contact(Visit visit) const {
    Seen seen(width());
    for (std::uint32_t e = 0; e < edges_.size(); ++e) {
      const std::int64_t low = edges_[e].low, high = edges_[e].high;
      if (low != high) visit(low, high, read(e, low, seen.data()));
    }
  }

  /// Contacts that are added from now on are reviewed.
  void begin_reviews() { reviewed_ = true; }
  /// keep(low tag, high tag) for each contact that was added since the last review, or that was to be kept for another one:
  /// whether it is to be kept again. So few are looked at where few are of interest.
  template <class Keep>
  void review(Keep keep) {
    std::sort(to_review_.begin(), to_review_.end());
    std::vector<std::uint32_t> kept;
    std::uint32_t last = none;
    for (const std::uint32_t e : std::exchange(to_review_, {}))
      if (e != last && edges_[last = e].low != edges_[e].high && keep(edges_[e].low, edges_[e].high)) kept.push_back(e);
    to_review_ = std::move(kept);
  }
  /// Those that the next review sees, some of them more than once.
  template <class Visit>
  void for_each_to_review(Visit visit) const {
    for (const std::uint32_t e : to_review_)
      if (edges_[e].low != edges_[e].high) visit(edges_[e].low, edges_[e].high);
  }

  /// The same history as seen from the other side.
  void change_side(double* history) const {
    for (std::size_t d = 0; d < width(); ++d)
      if (flips_[d]) history[d] = -history[d];
  }
  std::vector<double> turned(const double* history) const {
    std::vector<double> h(history, history + width());
    change_side(h.data());
    return h;
  }
  bool contains(std::int64_t tag, std::int64_t partner) const;
  /// Which history components are vectors of space: first indices of three in a row. They turn with the body.
  void set_vectors(std::vector<int> firsts) { vectors_ = std::move(firsts); }
  const std::vector<int>& vectors() const { return vectors_; }
  /// A history (width() numbers) after the rotation of space.
  void turn(double* history, const Eigen::Matrix3d& by) const {
    for (const int v : vectors_) {
      const Vec3 turned = by * Vec3(history[v], history[v + 1], history[v + 2]);
      for (int d = 0; d < 3; ++d) history[v + d] = turned[d];
    }
  }
  /// Turns the histories of the contacts of `tag` with partners for which mine(partner) holds.
  template <class Mine>
  void turn(std::int64_t tag, const Eigen::Matrix3d& by, Mine mine) {
    if (vectors_.empty()) return;
    for (std::uint32_t e = first(tag); e != none; e = next(e, tag))
      if (edges_[e].has_history && mine(other(e, tag))) turn(histories_.row(e), by);
  }
  /// The contacts of `tag` stay, without their histories.
  void forget_histories(std::int64_t tag) {
    for (std::uint32_t e = first(tag); e != none; e = next(e, tag)) edges_[e].has_history = false;
  }
  /// Removes all contacts of `tag`.
  void erase(std::int64_t tag);
  /// Removes those with partners for which goes(partner) holds, which is asked in the order of for_each_here().
  template <class Goes>
  void drop(std::int64_t tag, Goes goes) {
    for (std::uint32_t e = first(tag), after; e != none; e = after) {
      after = next(e, tag);
      if (goes(other(e, tag))) remove(e);
    }
  }
  /// Gives room back that was needed once: at most twice what its edges need stays, and a chunk.
  void fit();
  std::size_t size() const { return count_; }
  std::size_t memory_bytes() const;

 private:
  static constexpr std::uint32_t none = 0x7fffffff;
  struct Edge {
    std::int32_t low, high;        // tags, low < high; equal where the place is free
    std::uint32_t next_low;        // the next edge in the list of the low tag, or the next free place
    std::uint32_t next_high : 31;  // likewise of the high tag
    std::uint32_t has_history : 1;
  };
  /// Room for one history, off the heap for the widths that occur.
  class Seen {
   public:
    explicit Seen(std::size_t width) : wide_(width > few_.size() ? width : 0) {}
    double* data() { return wide_.empty() ? few_.data() : wide_.data(); }

   private:
    std::array<double, 32> few_;
    std::vector<double> wide_;
  };

  std::uint32_t first(std::int64_t tag) const {
    const std::uint32_t* head = heads_.find(narrow_tag(tag));
    return head ? *head - 1 : none;
  }
  std::int64_t other(std::uint32_t e, std::int64_t tag) const { return edges_[e].low == tag ? edges_[e].high : edges_[e].low; }
  std::uint32_t next(std::uint32_t e, std::int64_t tag) const {
    return edges_[e].low == tag ? edges_[e].next_low : edges_[e].next_high;
  }
  void set_next(std::uint32_t e, std::int64_t tag, std::uint32_t next) {
    if (edges_[e].low == tag)
      edges_[e].next_low = next;
    else
      edges_[e].next_high = next & none;
  }
  std::uint32_t find(std::int64_t tag, std::int64_t partner) const;
  std::uint32_t link(std::int64_t tag, std::int64_t partner);
  void unlink(std::uint32_t e, std::int64_t tag);
  void remove(std::uint32_t e);
  const double* read(std::uint32_t e, std::int64_t tag, double* out) const;
  void write(std::uint32_t e, std::int64_t tag, const double* history);

  std::vector<bool> flips_;
  std::vector<int> vectors_;
  ChunkedArray<Edge> edges_;
  ChunkedArray<double> histories_{0};  // a row for each edge, as the low tag sees it
  std::uint32_t first_free_ = none;
  FlatMap<std::uint32_t, std::int32_t> heads_;  // tag -> its first edge, counted from 1
  std::vector<std::uint32_t> unturned_;
  bool reviewed_ = false;
  std::vector<std::uint32_t> to_review_;
  std::size_t count_ = 0;
  Elsewhere elsewhere_;
};

}  // namespace solidcull
