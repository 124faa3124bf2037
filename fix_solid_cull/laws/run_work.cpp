#include "run_work.h"

#include <algorithm>

namespace solidcull {
namespace {

constexpr double fewest_steps = 100, shortest = 0.5;         // s
constexpr double fewest_atoms = 500, fewest_exterior = 100;  // mean, of the rank with most work

}  // namespace

RunWork sum_of(const std::vector<RunWork>& ranks) {
  RunWork sum;
  for (const RunWork& r : ranks) {
    sum.steps = std::max(sum.steps, r.steps);
    sum.seconds = std::max(sum.seconds, r.seconds);
    sum.in_fix = std::max(sum.in_fix, r.in_fix);
    sum.in_pairs = std::max(sum.in_pairs, r.in_pairs);
    sum.exterior += r.exterior;
    sum.interface += r.interface;
    sum.interior += r.interior;
    sum.pairs += r.pairs;
    sum.exterior_ends += r.exterior_ends;
    sum.restored += r.restored;
    sum.in_vain += r.in_vain;
    sum.awake.add(r.awake, 1);
  }
  return sum;
}

/// Time goes into pairs and into granules, and the fix. The run says what one of each costs. Without the fix each granule would
/// have half as many pairs as an exterior one has neighbours, for each pair is two granules': with it, neighbours that are
/// interface granules have nothing to share. All that on the rank that worked most, for the others have waited for it.
double seconds_without(const std::vector<RunWork>& ranks) {
  const auto busiest =
      std::max_element(ranks.begin(), ranks.end(), [](const RunWork& a, const RunWork& b) { return a.in_pairs < b.in_pairs; });
  if (busiest == ranks.end()) return 0;
  const RunWork& w = *busiest;
  if (w.steps < fewest_steps || w.seconds < shortest || w.mean(w.computed()) < fewest_atoms ||
      w.mean(w.exterior) < fewest_exterior || w.pairs == 0)
    return 0;
  const double of_pair = w.in_pairs / w.pairs;
  const double of_granule = std::max(0.0, w.seconds - w.in_fix - w.in_pairs) / w.computed();
  const double pairs_of_granule = w.exterior_ends / w.exterior / 2;
  double most = 0;  // granule-steps of a rank
  for (const RunWork& r : ranks) most = std::max(most, r.all());
  return most * (pairs_of_granule * of_pair + of_granule);
}

}  // namespace solidcull
