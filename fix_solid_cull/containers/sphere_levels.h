// Spheres of very unequal sizes sorted into one grid of cells per octave of size: who can touch this one? A tool or a boulder in
// a bed of fines then costs what is near it, where one grid would have cells as wide as the largest sphere reaches (the
// multilevel contact detection of Ogarko & Luding, Comput. Phys. Commun. 183, 2012). Built at once, O(n); local to the rank.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace solidcull {

class SphereLevels {
 public:
  /// n centres (m) and radii (m, above 0). Two spheres are near when their centres are at most (r1 + r2) factor + skin (m) apart.
  void build(int n, const double* const* centres, const double* radii, double factor, double skin);

  /// Calls visit(index, squared distance in m^2) for each sphere near the one at this place, itself included if it is in. Decides
  /// by the sum of squares in the order x, y, z and compares with <=, so that others who do the same find the same pairs.
  template <class Visit>
  void for_each_near(const double* at, double radius, Visit visit) const {
    for (const Level& level : levels_) {
      const double reach = (radius + level.largest) * factor_ + skin_;
      std::array<int, 3> a, b;
      bool beside = false;
      for (int d = 0; d < 3; ++d) {
        beside = beside || at[d] + reach < level.lo[d] || at[d] - reach > level.hi[d];
        a[d] = level.cell(d, at[d] - reach);
        b[d] = level.cell(d, at[d] + reach);
      }
      if (beside) continue;
      for (int i = a[0]; i <= b[0]; ++i)
        for (int j = a[1]; j <= b[1]; ++j) {
          const std::size_t row = level.row(i, j);
          const Place* const last = level.places.data() + level.start[row + b[2] + 1];
          for (const Place* p = level.places.data() + level.start[row + a[2]]; p != last; ++p) {
            const double dx = at[0] - p->x[0], dy = at[1] - p->x[1], dz = at[2] - p->x[2];
            const double apart = dx * dx + dy * dy + dz * dz;
            const double near = (radius + p->radius) * factor_ + skin_;
            if (apart <= near * near) visit(p->index, apart);
          }
        }
    }
  }

  std::size_t levels() const { return levels_.size(); }

 private:
  struct Place {
    std::array<double, 3> x;
    double radius;
    int index;
  };
  struct Level {
    double largest = 0, inverse = 0;
    std::array<double, 3> lo{}, hi{};
    std::array<int, 3> n{1, 1, 1};
    std::vector<int> start;  // of each cell's places; one more at the end
    std::vector<Place> places;

    int cell(int d, double x) const {
      const double c = (x - lo[d]) * inverse;
      return !(c > 0) ? 0 : c >= n[d] ? n[d] - 1 : static_cast<int>(c);  // what is no number is somewhere, too
    }
    std::size_t row(int i, int j) const { return (static_cast<std::size_t>(i) * n[1] + j) * n[2]; }
    void sort_into_cells(std::vector<Place>& found, double edge);
  };

  std::vector<Level> levels_;
  double factor_ = 1, skin_ = 0;
};

}  // namespace solidcull
