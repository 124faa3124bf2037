// Spheres near the borders of subdomains, exchanged so that each rank sees what is close to it, periodic images too.
#pragma once

#include <vector>

#include "pointers.h"
#include "sphere.h"

namespace solidcull {

class Halo : protected LAMMPS_NS::Pointers {
 public:
  explicit Halo(LAMMPS_NS::LAMMPS* lmp) : Pointers(lmp) {}

  /// Subdomains may have moved: reads them anew. Collective.
  void update();
  /// False where one rank owns a box without periodic sides: then an exchange would give nothing.
  bool needed() const { return needed_; }

  /// Rows of `columns` doubles that start with a position (m). Each row goes to every other rank (and periodic image) within
  /// `width` (m) of whose subdomain the position lies; what comes back has its position shifted into this rank's neighbourhood.
  /// Collective: all ranks name the same columns and width.
  std::vector<double> exchange(const std::vector<double>& rows, int columns, double width) const;

  /// All rows of all ranks, in rank order, on every rank. Collective.
  std::vector<double> gather_all(const std::vector<double>& rows) const;

  /// The same on rank 0 only; empty elsewhere. Collective.
  std::vector<double> gather_root(const std::vector<double>& rows) const;

  /// Whether this rank's subdomain holds the place (periodic images wrapped).
  bool owns(const Vec3& position) const;

  /// Shifts by which periodic images of a place near this rank may differ, the zero shift first.
  const std::vector<Vec3>& image_shifts() const { return shifts_; }

  bool subdomain_changed() const;

 private:
  std::vector<double> gather(const std::vector<double>& rows, bool everywhere) const;

  std::vector<double> boxes_;  // six per rank: lo, hi
  std::vector<Vec3> shifts_{Vec3::Zero()};
  bool needed_ = false;
};

}  // namespace solidcull
