#include "sphere_bins.h"

#include <algorithm>

namespace solidcull {

void SphereBins::build(int n, const double* const* centres, const double* radii, const int* bin, const int* offsets,
                       int number_of_offsets, double factor, double skin) {
  factor_ = factor;
  skin_ = skin;
  runs_.clear();
  for (int k = 0; k < number_of_offsets; ++k)
    if (k > 0 && offsets[k] == offsets[k - 1] + 1)
      ++runs_.back().length;
    else
      runs_.push_back({offsets[k], 1});
  if (n == 0 || runs_.empty()) {
    runs_.clear();
    return;
  }
  const auto used = std::minmax_element(bin, bin + n);
  lowest_ = *used.first + offsets[0];
  const int bins = *used.second + offsets[number_of_offsets - 1] - lowest_ + 1;
  // counted two places on: while places are filled in, start_[b + 1] is where the next one of bin b goes
  start_.assign(static_cast<std::size_t>(bins) + 2, 0);
  for (int i = 0; i < n; ++i) ++start_[static_cast<std::size_t>(bin[i] - lowest_) + 2];
  for (std::size_t b = 2; b < start_.size(); ++b) start_[b] += start_[b - 1];
  places_.reset(new Place[static_cast<std::size_t>(n)]);  // NOLINT(modernize-make-unique): that would fill them first
  for (int i = 0; i < n; ++i)
    places_[static_cast<std::size_t>(start_[static_cast<std::size_t>(bin[i] - lowest_) + 1]++)] = {centres[i][0], centres[i][1],
                                                                                                   centres[i][2], radii[i], i};
}

const std::vector<SphereBins::Near>& SphereBins::above(int i, const double* at, double radius, int bin) {
  const double x = at[0], y = at[1], z = at[2];
  std::size_t n = 0;
  for (const Run& run : runs_) {
    const int other = bin - lowest_ + run.offset;
    const int* const first = &start_[static_cast<std::size_t>(other)];
    const Place *p = places_.get() + first[0], *const last = places_.get() + first[run.length];
    if (near_.size() < n + static_cast<std::size_t>(last - p)) near_.resize(2 * (n + static_cast<std::size_t>(last - p)));
    Near* const near = near_.data();
    for (; p != last; ++p) {  // without branches: which of them are near is anyone's guess
      const double dx = x - p->x, dy = y - p->y, dz = z - p->z;
      const double apart = dx * dx + dy * dy + dz * dz;
      const double reach = (radius + p->radius) * factor_ + skin_;
      near[n] = {p->index, apart};
      n += static_cast<std::size_t>((apart <= reach * reach) & (p->index > i));
    }
  }
  found_ = n;
  return near_;
}

}  // namespace solidcull
