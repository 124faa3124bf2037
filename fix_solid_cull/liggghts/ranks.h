// MPI ranks and periodic images, as LIGGGHTS divides the box among them.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "pointers.h"
#include "ports.h"
#include "rank_grid.h"

namespace solidcull {

class EngineRanks : public Ranks, protected LAMMPS_NS::Pointers {
 public:
  explicit EngineRanks(LAMMPS_NS::LAMMPS* lmp);

  bool any(bool here) const override;
  void sum(double* numbers, int n) const override;
  void sum(std::int64_t* numbers, int n) const override;
  void largest(double* numbers, int n) const override;
  void largest(std::int64_t* numbers, int n) const override;
  std::int64_t sum_before(std::int64_t number) const override;

  bool has_neighbours() const override { return has_neighbours_; }
  void follow_box() override;
  void update() override;
  bool subdomain_changed() const override;
  bool owns(const Vec3& place) const override;
  int owner(const Vec3& place) const override;
  const std::vector<Vec3>& image_shifts() const override { return shifts_; }
  std::unique_ptr<SharedFile> open_to_write(const std::string& file) const override;

 protected:
  void exchange_bytes(const void* rows, std::size_t n, std::size_t bytes, double width, const Room& room) const override;
  void gather_bytes(const void* rows, std::size_t n, std::size_t bytes, bool everywhere, const Room& room) const override;
  void deliver_bytes(const std::vector<Letter>& letters, std::size_t bytes, const RoomFrom& room) const override;

 private:
  struct Partner : RankGrid::Partner {
    int rank;
  };
  std::array<double, 6> own_borders() const;  // lo, hi
  RankGrid grid() const;
  const std::vector<Partner>& partners(double reach) const;

  std::array<double, 6> own_{};
  RankGrid grid_;
  bool known_ = false;  // both, as they were at the last update()
  std::vector<Vec3> shifts_{Vec3::Zero()};
  bool has_neighbours_ = false;
  mutable std::map<double, std::vector<Partner>> partners_;  // by reach, in the order of ranks
  mutable int deliveries_ = 0;
};

}  // namespace solidcull
