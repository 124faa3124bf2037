// Spheres in the bins of a grid that is given, side by side in memory: who can touch this one? For sizes that differ little; for
// others there is SphereLevels. Built at once, O(n + bins from the lowest to the highest in use); local to the rank.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

namespace solidcull {

class SphereBins {
 public:
  /// n centres (m) and radii (m), sphere i in bin bin[i]. Two spheres are near when their centres are at most
  /// (r1 + r2) factor + skin (m) apart. `offsets`: from a sphere's bin to those that may hold one near it, its own included,
  /// ascending.
  void build(int n, const double* const* centres, const double* radii, const int* bin, const int* offsets, int number_of_offsets,
             double factor, double skin);

  struct Near {
    int index;
    double apart;  ///< squared distance (m^2): the sum of squares in the order x, y, z
  };
  /// Those of higher index near sphere i, by bins and then by indices; valid until it is called again.
  const std::vector<Near>& above(int i, const double* at, double radius, int bin);
  /// How many the last call found.
  std::size_t found() const { return found_; }

 private:
  struct Place {
    double x, y, z, radius;
    int index;
  };
  struct Run {  // of bins side by side
    int offset, length;
  };

  int lowest_ = 0;          // bin that is looked at
  std::vector<int> start_;  // of its places and of those of the bins above; one more at the end
  std::unique_ptr<Place[]> places_;
  std::vector<Run> runs_;
  std::vector<Near> near_;
  std::size_t found_ = 0;
  double factor_ = 1, skin_ = 0;
};

}  // namespace solidcull
