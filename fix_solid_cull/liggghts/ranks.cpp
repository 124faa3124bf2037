#include "ranks.h"

#include <mpi.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "comm.h"
#include "domain.h"

namespace solidcull {
namespace {

/// MPI counts rows, so that messages may be larger than 2 GiB.
class RowType {
 public:
  explicit RowType(std::size_t bytes) {
    MPI_Type_contiguous(static_cast<int>(bytes), MPI_BYTE, &type_);
    MPI_Type_commit(&type_);
  }
  ~RowType() { MPI_Type_free(&type_); }
  RowType(const RowType&) = delete;
  operator MPI_Datatype() const { return type_; }

 private:
  MPI_Datatype type_;
};

}  // namespace

EngineRanks::EngineRanks(LAMMPS_NS::LAMMPS* lmp) : Pointers(lmp) {
  me = comm->me;
  count = comm->nprocs;
}

bool EngineRanks::any(bool here) const {
  if (count == 1) return here;
  int mine = here, anywhere = 0;
  MPI_Allreduce(&mine, &anywhere, 1, MPI_INT, MPI_MAX, world);
  return anywhere != 0;
}

void EngineRanks::sum(double* numbers, int n) const {
  if (count > 1) MPI_Allreduce(MPI_IN_PLACE, numbers, n, MPI_DOUBLE, MPI_SUM, world);
}
void EngineRanks::sum(std::int64_t* numbers, int n) const {
  if (count > 1) MPI_Allreduce(MPI_IN_PLACE, numbers, n, MPI_INT64_T, MPI_SUM, world);
}
void EngineRanks::largest(double* numbers, int n) const {
  if (count > 1) MPI_Allreduce(MPI_IN_PLACE, numbers, n, MPI_DOUBLE, MPI_MAX, world);
}
void EngineRanks::largest(std::int64_t* numbers, int n) const {
  if (count > 1) MPI_Allreduce(MPI_IN_PLACE, numbers, n, MPI_INT64_T, MPI_MAX, world);
}

/// A side of the box that is not periodic may follow the granules, and the rank at it owns what lies beyond.
std::array<double, 6> EngineRanks::own_borders() const {
  constexpr double no_border = std::numeric_limits<double>::infinity();
  std::array<double, 6> own;
  for (int d = 0; d < 3; ++d) {
    const bool periodic = domain->boundary[d][0] == 0;
    own[d] = !periodic && domain->sublo[d] <= domain->boxlo[d] ? -no_border : domain->sublo[d];
    own[3 + d] = !periodic && domain->subhi[d] >= domain->boxhi[d] ? no_border : domain->subhi[d];
  }
  return own;
}

void EngineRanks::follow_box() {
  constexpr int shrink_wrapped = 2;  // of Domain::nonperiodic
  if (count > 1 && domain->nonperiodic == shrink_wrapped) domain->reset_box();
}

void EngineRanks::update() {
  const std::array<double, 6> mine = own_borders();
  boxes_.resize(6 * static_cast<std::size_t>(count));
  MPI_Allgather(mine.data(), 6, MPI_DOUBLE, boxes_.data(), 6, MPI_DOUBLE, world);

  shifts_.assign(1, Vec3::Zero());
  const bool periodic[3] = {domain->xperiodic != 0, domain->yperiodic != 0, domain->zperiodic != 0};
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j)
      for (int k = -1; k <= 1; ++k) {
        if ((i == 0 && j == 0 && k == 0) || (i && !periodic[0]) || (j && !periodic[1]) || (k && !periodic[2])) continue;
        shifts_.emplace_back(i * domain->prd[0], j * domain->prd[1], k * domain->prd[2]);
      }
  has_neighbours_ = count > 1 || shifts_.size() > 1;
}

bool EngineRanks::subdomain_changed() const {
  if (boxes_.empty()) return true;
  const std::array<double, 6> now = own_borders();
  return !std::equal(now.begin(), now.end(), &boxes_[6 * static_cast<std::size_t>(me)]);
}

bool EngineRanks::owns(const Vec3& place) const {
  double x[3];
  set(x, place);
  domain->remap(x);
  for (int d = 0; d < 3; ++d) {
    const bool first = domain->sublo[d] <= domain->boxlo[d], last = domain->subhi[d] >= domain->boxhi[d];
    if ((x[d] < domain->sublo[d] && !first) || (x[d] >= domain->subhi[d] && !last)) return false;
  }
  return true;
}

void EngineRanks::exchange_bytes(const void* rows, std::size_t n, std::size_t bytes, double width, const Room& room) const {
  const char* const from = static_cast<const char*>(rows);
  std::vector<char> out;
  std::vector<int> send(count), receive(count), send_at(count), receive_at(count);
  for (int rank = 0; rank < count; ++rank) {
    const double* box = &boxes_[6 * static_cast<std::size_t>(rank)];
    send_at[rank] = static_cast<int>(out.size() / bytes);
    for (const Vec3& shift : shifts_) {
      if (rank == me && shift.isZero(0)) continue;
      for (std::size_t r = 0; r < n; ++r) {
        Triple at;
        std::memcpy(at.data(), from + r * bytes, sizeof at);
        bool near = true;
        for (int d = 0; d < 3; ++d) {
          at[d] += shift[d];
          near = near && !(at[d] < box[d] - width || at[d] > box[3 + d] + width);
        }
        if (!near) continue;
        const std::size_t place = out.size();
        out.insert(out.end(), from + r * bytes, from + (r + 1) * bytes);
        std::memcpy(&out[place], at.data(), sizeof at);
      }
    }
    send[rank] = static_cast<int>(out.size() / bytes) - send_at[rank];
  }
  MPI_Alltoall(send.data(), 1, MPI_INT, receive.data(), 1, MPI_INT, world);
  int total = 0;
  for (int r = 0; r < count; ++r) {
    receive_at[r] = total;
    total += receive[r];
  }
  const RowType row(bytes);
  MPI_Alltoallv(out.data(), send.data(), send_at.data(), row, room(static_cast<std::size_t>(total)), receive.data(),
                receive_at.data(), row, world);
}

void EngineRanks::gather_bytes(const void* rows, std::size_t n, std::size_t bytes, bool everywhere, const Room& room) const {
  if (count == 1) {
    void* const to = room(n);
    if (n) std::memcpy(to, rows, n * bytes);
    return;
  }
  const int mine = static_cast<int>(n);
  std::vector<int> counts(count), at(count);
  MPI_Allgather(&mine, 1, MPI_INT, counts.data(), 1, MPI_INT, world);
  int total = 0;
  for (int r = 0; r < count; ++r) {
    at[r] = total;
    total += counts[r];
  }
  void* const to = room(everywhere || me == 0 ? static_cast<std::size_t>(total) : 0);
  const RowType row(bytes);
  if (everywhere)
    MPI_Allgatherv(rows, mine, row, to, counts.data(), at.data(), row, world);
  else
    MPI_Gatherv(rows, mine, row, to, counts.data(), at.data(), row, 0, world);
}

}  // namespace solidcull
