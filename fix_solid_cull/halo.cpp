#include "halo.h"

#include <mpi.h>

#include <algorithm>

#include "comm.h"
#include "domain.h"

namespace solidcull {

void Halo::update() {
  const int ranks = comm->nprocs;
  double mine[6];
  for (int d = 0; d < 3; ++d) {
    mine[d] = domain->sublo[d];
    mine[3 + d] = domain->subhi[d];
  }
  boxes_.resize(6 * static_cast<std::size_t>(ranks));
  MPI_Allgather(mine, 6, MPI_DOUBLE, boxes_.data(), 6, MPI_DOUBLE, world);

  shifts_.assign(1, Vec3::Zero());
  const bool periodic[3] = {domain->xperiodic != 0, domain->yperiodic != 0, domain->zperiodic != 0};
  for (int i = -1; i <= 1; ++i)
    for (int j = -1; j <= 1; ++j)
      for (int k = -1; k <= 1; ++k) {
        if ((i == 0 && j == 0 && k == 0) || (i && !periodic[0]) || (j && !periodic[1]) || (k && !periodic[2])) continue;
        shifts_.emplace_back(i * domain->prd[0], j * domain->prd[1], k * domain->prd[2]);
      }
  needed_ = ranks > 1 || shifts_.size() > 1;
}

bool Halo::subdomain_changed() const {
  if (boxes_.empty()) return true;
  const double* mine = &boxes_[6 * static_cast<std::size_t>(comm->me)];
  for (int d = 0; d < 3; ++d)
    if (mine[d] != domain->sublo[d] || mine[3 + d] != domain->subhi[d]) return true;
  return false;
}

std::vector<double> Halo::exchange(const std::vector<double>& rows, int columns, double width) const {
  const int ranks = comm->nprocs;
  std::vector<std::vector<double>> out(ranks);
  for (int rank = 0; rank < ranks; ++rank) {
    const double* box = &boxes_[6 * static_cast<std::size_t>(rank)];
    for (const Vec3& shift : shifts_) {
      if (rank == comm->me && shift.isZero(0)) continue;
      for (std::size_t r = 0; r < rows.size(); r += columns) {
        const double x = rows[r] + shift[0], y = rows[r + 1] + shift[1], z = rows[r + 2] + shift[2];
        if (x < box[0] - width || x > box[3] + width || y < box[1] - width || y > box[4] + width || z < box[2] - width ||
            z > box[5] + width)
          continue;
        const std::size_t at = out[rank].size();
        out[rank].insert(out[rank].end(), rows.begin() + static_cast<std::ptrdiff_t>(r),
                         rows.begin() + static_cast<std::ptrdiff_t>(r + columns));
        out[rank][at] = x;
        out[rank][at + 1] = y;
        out[rank][at + 2] = z;
      }
    }
  }
  std::vector<int> send(ranks), receive(ranks), send_at(ranks), receive_at(ranks);
  for (int r = 0; r < ranks; ++r) send[r] = static_cast<int>(out[r].size());
  MPI_Alltoall(send.data(), 1, MPI_INT, receive.data(), 1, MPI_INT, world);
  std::vector<double> flat;
  int total = 0;
  for (int r = 0; r < ranks; ++r) {
    send_at[r] = static_cast<int>(flat.size());
    flat.insert(flat.end(), out[r].begin(), out[r].end());
    receive_at[r] = total;
    total += receive[r];
  }
  std::vector<double> in(total);
  MPI_Alltoallv(flat.data(), send.data(), send_at.data(), MPI_DOUBLE, in.data(), receive.data(), receive_at.data(), MPI_DOUBLE,
                world);
  return in;
}

std::vector<double> Halo::gather(const std::vector<double>& rows, bool everywhere) const {
  const int ranks = comm->nprocs;
  if (ranks == 1) return rows;
  int mine = static_cast<int>(rows.size());
  std::vector<int> counts(ranks), at(ranks);
  MPI_Allgather(&mine, 1, MPI_INT, counts.data(), 1, MPI_INT, world);
  int total = 0;
  for (int r = 0; r < ranks; ++r) {
    at[r] = total;
    total += counts[r];
  }
  std::vector<double> all(everywhere || comm->me == 0 ? total : 0);
  if (everywhere)
    MPI_Allgatherv(rows.data(), mine, MPI_DOUBLE, all.data(), counts.data(), at.data(), MPI_DOUBLE, world);
  else
    MPI_Gatherv(rows.data(), mine, MPI_DOUBLE, all.data(), counts.data(), at.data(), MPI_DOUBLE, 0, world);
  return all;
}

std::vector<double> Halo::gather_all(const std::vector<double>& rows) const { return gather(rows, true); }
std::vector<double> Halo::gather_root(const std::vector<double>& rows) const { return gather(rows, false); }

bool Halo::owns(const Vec3& position) const {
  double x[3] = {position[0], position[1], position[2]};
  domain->remap(x);
  for (int d = 0; d < 3; ++d) {
    const bool first = domain->sublo[d] <= domain->boxlo[d], last = domain->subhi[d] >= domain->boxhi[d];
    if ((x[d] < domain->sublo[d] && !first) || (x[d] >= domain->subhi[d] && !last)) return false;
  }
  return true;
}

}  // namespace solidcull
