// Pairs of granules by their tags, the lower one first.
#pragma once

#include <algorithm>
#include <cstdint>
#include <set>
#include <utility>

namespace solidcull {

using TagPair = std::pair<std::int64_t, std::int64_t>;
using TagPairs = std::set<TagPair>;

inline TagPair ordered(std::int64_t a, std::int64_t b) { return {std::min(a, b), std::max(a, b)}; }

}  // namespace solidcull
