// Parts of bodies on several ranks that are tied together: which are one body, and sums over it along a tree of its ranks
// (theory.md#ranks). No rank knows more of a body than its own parts and what these touch.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <map>
#include <type_traits>
#include <utility>
#include <vector>

#include "ports.h"

namespace solidcull {

/// A part of another rank that a part of this one is tied to.
struct PartLink {
  int rank, body;                   ///< its number there
  Vec3 to_other;                    ///< brings this part's periodic image to that one's (m)
  std::array<bool, 3> tied_anew{};  ///< a further contact between the two brings it to another image in these directions
};

class RankTrees {
 public:
  /// Of a body that spans ranks; a rank may have several parts of one body.
  struct Part {
    int body;                    ///< on this rank
    std::int64_t key;            ///< the smallest of those of its parts: the body's number on all ranks
    Vec3 shift = Vec3::Zero();   ///< brings this part's image to that in which the whole is summed (m)
    std::array<bool, 3> tied{};  ///< here the body is seen to be tied to its own periodic image in these directions
  };

  explicit RankTrees(const Ranks& ranks) : ranks_(ranks) {}

  /// Bodies over all ranks are numbered from 1; 0: no body.
  std::int64_t own_key(int body) const { return static_cast<std::int64_t>(body) * ranks_.count + ranks_.me; }

  /// Finds the trees anew: each of this rank's parts by number, with its links, which the other rank has too. `periods`: edges of
  /// the box where it is periodic, else 0 (m). Collective.
  void grow(const std::map<int, std::vector<PartLink>>& links, const Vec3& periods);
  /// Every body is on one rank. Local.
  void clear();

  /// By key, then as sums go up; valid until the next grow().
  const std::vector<Part>& parts() const { return parts_; }
  /// Place of a body of this rank in parts(), -1: all of it is here. Local.
  int place_of(int body) const {
    const auto at = place_.find(body);
    return at == place_.end() ? -1 : at->second;
  }

  /// Rows, one for each of parts(), become the whole body's: unite(row, other) adds another part's row. The order of the sums is
  /// always the same. Messages go among the ranks of each body, and none for those of which takes_part(place) is false, which all
  /// its ranks say alike. Collective among them.
  template <class Row, class Unite, class TakesPart>
  void unite(std::vector<Row>& rows, Unite unite, TakesPart takes_part) const {
    static_assert(std::is_trivially_copyable<Row>::value, "a row is plain data");
    for (std::size_t p = 0; p < parts_.size(); ++p) {
      if (!takes_part(static_cast<int>(p))) continue;
      for (const Neighbour& child : branches_[p].children) {
        Row other;
        receive(p, child, &other, sizeof other);
        unite(rows[p], other);
      }
      if (branches_[p].level > 0) send(p, branches_[p].parent, &rows[p], sizeof(Row));
    }
    for (const std::size_t p : downwards_) {
      if (!takes_part(static_cast<int>(p))) continue;
      if (branches_[p].level > 0) receive(p, branches_[p].parent, &rows[p], sizeof(Row));
      for (const Neighbour& child : branches_[p].children) send(p, child, &rows[p], sizeof(Row));
    }
  }
  template <class Row, class Unite>
  void unite(std::vector<Row>& rows, Unite unite_rows) const {
    unite(rows, unite_rows, [](int) { return true; });
  }

 private:
  struct Neighbour {
    int rank, body;
  };
  struct Branch {
    int level = 0;  // links between it and the part whose key the body has
    Neighbour parent{-1, 0};
    std::vector<Neighbour> children;
  };
  struct Note;
  struct Growing;
  void send(std::size_t part, const Neighbour& to, const void* row, std::size_t bytes) const;
  void receive(std::size_t part, const Neighbour& from, void* row, std::size_t bytes) const;

  const Ranks& ranks_;
  std::vector<Part> parts_;
  std::vector<Branch> branches_;        // of parts_
  std::vector<std::size_t> downwards_;  // parts_ in the order in which sums come back
  std::map<int, int> place_;
  mutable std::map<std::array<int, 3>, std::vector<char>>
      early_;  // rows that came before they were asked for: from rank, to, from
};

}  // namespace solidcull
