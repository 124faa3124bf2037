#include "sphere_levels.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace solidcull {

void SphereLevels::build(int n, const double* const* centres, const double* radii, double factor, double skin) {
  factor_ = factor;
  skin_ = skin;
  levels_.clear();
  double largest = 0;
  for (int i = 0; i < n; ++i) largest = std::max(largest, radii[i]);
  std::map<int, std::vector<Place>> octaves;  // radii in (largest/2^(o+1), largest/2^o]
  std::vector<Place>* last = nullptr;
  int last_octave = 0;
  for (int i = 0; i < n; ++i) {
    const int octave = std::min(60, std::ilogb(largest / radii[i]));
    if (!last || octave != last_octave) last = &octaves[octave];
    last_octave = octave;
    last->push_back({{centres[i][0], centres[i][1], centres[i][2]}, radii[i], i});
  }
  for (auto& [octave, found] : octaves) {
    Level level;
    for (const Place& p : found) level.largest = std::max(level.largest, p.radius);
    level.sort_into_cells(found, 2 * level.largest * factor + skin);
    levels_.push_back(std::move(level));
  }
}

void SphereLevels::Level::sort_into_cells(std::vector<Place>& found, double edge) {
  lo = hi = found.front().x;
  for (const Place& p : found)
    for (int d = 0; d < 3; ++d) {
      lo[d] = std::min(lo[d], p.x[d]);
      hi[d] = std::max(hi[d], p.x[d]);
    }
  // few spheres far apart would need many cells: up to a million are cheaper than crowded ones
  const double spheres = static_cast<double>(found.size());
  const double most = std::max(4 * spheres + 64, std::min(64 * spheres, 1048576.0));
  std::array<double, 3> extent;
  for (int d = 0; d < 3; ++d) extent[d] = std::isfinite(hi[d] - lo[d]) ? hi[d] - lo[d] : 0;
  for (;; edge *= 1.5) {
    inverse = 1 / edge;
    for (int d = 0; d < 3; ++d) n[d] = static_cast<int>(std::min(1e6, extent[d] * inverse)) + 1;
    if (static_cast<double>(n[0]) * n[1] * n[2] <= most) break;
  }
  const auto index = [this](const Place& p) { return row(cell(0, p.x[0]), cell(1, p.x[1])) + cell(2, p.x[2]); };
  start.assign(static_cast<std::size_t>(n[0]) * n[1] * n[2] + 1, 0);
  std::vector<int> cell_of(found.size());
  for (std::size_t s = 0; s < found.size(); ++s) ++start[(cell_of[s] = static_cast<int>(index(found[s]))) + 1];
  for (std::size_t c = 1; c < start.size(); ++c) start[c] += start[c - 1];
  places.resize(found.size());
  std::vector<int> at(start.begin(), start.end() - 1);
  for (std::size_t s = 0; s < found.size(); ++s) places[at[cell_of[s]]++] = found[s];
}

}  // namespace solidcull
