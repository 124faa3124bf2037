#include "run_work.h"

#include <algorithm>

namespace solidcull {
namespace {

constexpr double fewest_steps = 100, shortest = 0.5;         // s
constexpr double fewest_atoms = 500, fewest_exterior = 100;  // mean, of the rank with most work

}  // namespace

void RunWork::add(const RunWork& o, double times) {
  steps += times * o.steps;
  exterior += times * o.exterior;
  interface += times * o.interface;
  interior += times * o.interior;
  pairs += times * o.pairs;
  exterior_ends += times * o.exterior_ends;
  seconds += times * o.seconds;
  in_fix += times * o.in_fix;
  in_pairs += times * o.in_pairs;
  restored += times * o.restored;
  in_vain += times * o.in_vain;
  awake.add(o.awake, times);
  woken.add(o.woken, times);
}

RunWork sum_of(const std::vector<RunWork>& ranks) {
  RunWork sum;
  for (const RunWork& r : ranks) sum.add(r, 1);
  for (double RunWork::*of_all : {&RunWork::steps, &RunWork::seconds, &RunWork::in_fix, &RunWork::in_pairs}) {
    sum.*of_all = 0;
    for (const RunWork& r : ranks) sum.*of_all = std::max(sum.*of_all, r.*of_all);
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
