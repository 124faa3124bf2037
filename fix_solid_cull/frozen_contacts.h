// Contacts between two locked granules. The engine excludes such pairs from its lists; their histories wait here, each once.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "flat_map.h"
#include "sphere.h"

namespace solidcull {

/// An undirected graph: nodes are granule tags, edges are contacts with a history of `width` numbers (may be 0).
/// A history has a sense: component d changes its sign with the side it is seen from where flips[d] is true.
/// Local to the rank; a contact across ranks stands in the graph of either rank.
class FrozenContacts {
 public:
  /// flips: one entry per history component, true for vector-like ones (the engine's "newton" flag of that component).
  void set_layout(std::vector<bool> flips);
  const std::vector<bool>& layout() const { return flips_; }
  std::size_t width() const { return flips_.size(); }

  /// Adds the contact of `tag` with `partner`, history as `tag` sees it (`width()` numbers, or nullptr: touching without
  /// history). A contact that is there already keeps its place and takes the new history.
  void add(std::int64_t tag, std::int64_t partner, const double* history);

  /// Calls visit(partner, history as `tag` sees it or nullptr) for each contact of `tag`.
  template <class Visit>
  void for_each(std::int64_t tag, Visit visit) const {
    std::vector<double> seen(width());
    const int* head = heads_.find(tag);
    for (int e = head ? *head : none; e != none; e = next(e, tag)) {
      const Edge& edge = edges_[e];
      visit(edge.low == tag ? edge.high : edge.low, read(e, tag, seen.data()));
    }
  }
  /// Partners only; cheaper.
  template <class Visit>
  void for_each_partner(std::int64_t tag, Visit visit) const {
    const int* head = heads_.find(tag);
    for (int e = head ? *head : none; e != none; e = next(e, tag)) visit(edges_[e].low == tag ? edges_[e].high : edges_[e].low);
  }
  /// Every contact once: visit(low tag, high tag, history as the low tag sees it or nullptr).
  template <class Visit>
  void for_each_contact(Visit visit) const {
    std::vector<double> seen(width());
    for (std::size_t e = 0; e < edges_.size(); ++e)
      if (edges_[e].low != free_mark) visit(edges_[e].low, edges_[e].high, read(static_cast<int>(e), edges_[e].low, seen.data()));
  }

  /// The same history as seen from the other side.
  std::vector<double> turned(const double* history) const {
    std::vector<double> h(history, history + width());
    for (std::size_t d = 0; d < width(); ++d)
      if (flips_[d]) h[d] = -h[d];
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
    const int* head = heads_.find(tag);
    for (int e = head ? *head : none; e != none; e = next(e, tag))
      if (edges_[e].has_history && mine(edges_[e].low == tag ? edges_[e].high : edges_[e].low))
        turn(histories_.data() + static_cast<std::size_t>(e) * width(), by);
  }
  /// Removes all contacts of `tag`.
  void erase(std::int64_t tag);
  std::size_t size() const { return count_; }
  std::size_t memory_bytes() const;

 private:
  static constexpr int none = -1;
  static constexpr std::int64_t free_mark = INT64_MIN;
  struct Edge {
    std::int64_t low, high;   // tags, low < high
    int next_low, next_high;  // the next edge in the list of either end
    bool has_history;
  };

  int next(int e, std::int64_t tag) const { return edges_[e].low == tag ? edges_[e].next_low : edges_[e].next_high; }
  int& next(int e, std::int64_t tag) { return edges_[e].low == tag ? edges_[e].next_low : edges_[e].next_high; }
  int find(std::int64_t tag, std::int64_t partner) const;
  void unlink(int e, std::int64_t tag);
  const double* read(int e, std::int64_t tag, double* out) const;
  void write(int e, std::int64_t tag, const double* history);

  std::vector<bool> flips_;
  std::vector<int> vectors_;
  std::vector<Edge> edges_;
  std::vector<double> histories_;  // width() per edge, as the low tag sees it
  std::vector<int> free_;
  FlatMap<int> heads_;
  std::size_t count_ = 0;
};

}  // namespace solidcull
