// What audits have found: what granules that sleep would have done, had they been awake (theory.md#audit).
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace solidcull {

/// What the granules of a patch did that an audit woke, until its end, or until they would have woken anyway: sums.
struct AuditedPatch {
  double granules = 0;
  double ended = 0;       ///< of them, those that would have woken anyway
  double moved = 0;       ///< ways (m)
  double energy = 0;      ///< kinetic energies then (J)
  double deep = 0;        ///< of them, those that touched neither walls nor what was awake
  double load = 0;        ///< and what they were pressed with at first: their normal contact forces (N)
  double load_shift = 0;  ///< and by how much that has changed, each without its sign (N)

  void add(const AuditedPatch& other);
};

struct Interval {
  double low = 0, high = 0;
};

/// Alike on all ranks.
class AuditTally {
 public:
  enum Figure { moved, load_shift, energy, figures };  ///< of a granule: m, N, J

  /// Those of an audit; patches in which nothing slept do not count.
  void add(const std::vector<AuditedPatch>& patches);
  std::size_t patches() const { return patches_.size(); }
  const AuditedPatch& all() const { return all_; }
  /// Holds the mean of what sleeps near what is awake, in 90 of 100 cases; 0 to 0 where there are fewer than `fewest` patches.
  const Interval& interval(Figure figure) const { return intervals_[figure]; }
  static constexpr std::size_t fewest = 6;

 private:
  Interval interval_of(Figure figure) const;

  std::vector<AuditedPatch> patches_;
  AuditedPatch all_;
  std::array<Interval, figures> intervals_;  // of them
};

/// For the block at the end of a run; empty where there was no audit. `steps` that each took; mean `diameter` (m).
std::string text_of(const AuditTally& tally, int steps, double diameter);

}  // namespace solidcull
