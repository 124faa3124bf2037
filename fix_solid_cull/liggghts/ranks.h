// MPI ranks and periodic images, as LIGGGHTS divides the box among them.
#pragma once

#include <mpi.h>

#include <array>
#include <list>
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
  ~EngineRanks() override;

  bool any(bool here) const override;
  void sum(double* numbers, int n) const override;
  void sum(std::int64_t* numbers, int n) const override;
  void largest(double* numbers, int n) const override;
  void largest(std::int64_t* numbers, int n) const override;
  std::int64_t sum_before(std::int64_t number) const override;

  void begin_any(unsigned bits) const override;
  unsigned end_any() const override;

  void send(int rank, const void* bytes, std::size_t n) const override;
  std::vector<char> receive(int rank) const override;

  bool has_neighbours() const override { return has_neighbours_; }
  void follow_box() override;
  void update() override;
  bool subdomains_changed() const override;
  int owner(const Vec3& place) const override;
  Box own() const override;
  std::array<std::vector<double>, 3> cuts() const override;
  double thinnest() const override;
  void move_cuts(const std::array<std::vector<double>, 3>& to) override;
  int hops() const override;
  bool is_far_out(const Vec3& place) const override;
  bool brings_home(const Vec3& place) const override;
  void expect_far_out(bool on) override { far_out_ = on; }
  std::vector<int> neighbours(double width) const override;
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
  struct Message {
    std::vector<char> bytes;
    MPI_Request request;
  };
  RankGrid grid() const;
  RankGrid::Cell cell_of(const Vec3& place) const;
  const std::vector<Partner>& partners(double reach) const;
  const std::vector<Partner>& partners_within(double width) const;
  void forget_sent() const;

  RankGrid grid_;                               // as it was at the last update()
  Vec3 lo_ = Vec3::Zero(), hi_ = Vec3::Zero();  // this rank's cell of it
  bool far_out_ = true;
  std::vector<Vec3> shifts_{Vec3::Zero()};
  bool has_neighbours_ = false;
  mutable std::map<double, std::vector<Partner>> partners_;  // by reach, in the order of ranks
  mutable std::list<Message> sent_;                          // that MPI still needs
  mutable unsigned asked_ = 0, answer_ = 0;
  mutable MPI_Request asking_ = MPI_REQUEST_NULL;
  mutable int deliveries_ = 0;
};

}  // namespace solidcull
