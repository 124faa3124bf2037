#include "uneven_ranks.h"

#include <algorithm>
#include <cstdint>

namespace solidcull {
namespace {

constexpr std::int64_t few = 100;  // granules a rank, on average: nobody minds where they are
constexpr std::int64_t share = 5;  // of the mean: one part in so many

}  // namespace

std::string uneven_ranks(const Bed& bed) {
  if (bed.ranks.count == 1) return {};
  const std::int64_t here = bed.atoms.owned + static_cast<std::int64_t>(bed.solid.store().size()), ranks = bed.ranks.count;
  std::int64_t all = here, least = -(here * ranks + bed.ranks.me);  // the least number, and whose
  bed.ranks.sum(&all, 1);
  bed.ranks.largest(&least, 1);
  least = -least;
  const std::int64_t mean = all / ranks;
  if (mean < few || share * (least / ranks) >= mean) return {};
  return "rank " + std::to_string(least % ranks) + " has " + std::to_string(least / ranks) + " granules, the mean of " +
         std::to_string(ranks) + " ranks is " + std::to_string(mean) +
         ": it waits for the others. 'processors * * 1' before the box is made cuts no tall box in z";
}

}  // namespace solidcull
