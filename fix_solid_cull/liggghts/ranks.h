// MPI ranks and periodic images, as LIGGGHTS divides the box among them.
#pragma once

#include <array>
#include <vector>

#include "pointers.h"
#include "ports.h"

namespace solidcull {

class EngineRanks : public Ranks, protected LAMMPS_NS::Pointers {
 public:
  explicit EngineRanks(LAMMPS_NS::LAMMPS* lmp);

  bool any(bool here) const override;
  void sum(double* numbers, int n) const override;
  void sum(std::int64_t* numbers, int n) const override;
  void largest(double* numbers, int n) const override;
  void largest(std::int64_t* numbers, int n) const override;

  bool has_neighbours() const override { return has_neighbours_; }
  void follow_box() override;
  void update() override;
  bool subdomain_changed() const override;
  bool owns(const Vec3& place) const override;
  const std::vector<Vec3>& image_shifts() const override { return shifts_; }

 protected:
  void exchange_bytes(const void* rows, std::size_t n, std::size_t bytes, double width, const Room& room) const override;
  void gather_bytes(const void* rows, std::size_t n, std::size_t bytes, bool everywhere, const Room& room) const override;

 private:
  std::array<double, 6> own_borders() const;  // lo, hi

  std::vector<double> boxes_;  // six per rank: lo, hi
  std::vector<Vec3> shifts_{Vec3::Zero()};
  bool has_neighbours_ = false;
};

}  // namespace solidcull
