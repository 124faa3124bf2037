#include "ranks.h"

#include <mpi.h>

#include <algorithm>
#include <cstring>
#include <iterator>
#include <limits>
#include <utility>

#include "comm.h"
#include "domain.h"
#include "internal_error.h"
#include "mpi_file.h"
#include "neighbor.h"

namespace solidcull {
namespace {

// LIGGGHTS's own messages have other tags
constexpr int exchange_tag = 7311, message_tag = 7312, delivery_tag = 7313;  // deliveries take two tags by turns

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

EngineRanks::~EngineRanks() {
  for (Message& m : sent_) MPI_Wait(&m.request, MPI_STATUS_IGNORE);
  MPI_Wait(&asking_, MPI_STATUS_IGNORE);
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

std::int64_t EngineRanks::sum_before(std::int64_t number) const {
  std::int64_t before = 0;
  if (count > 1) MPI_Exscan(&number, &before, 1, MPI_INT64_T, MPI_SUM, world);
  return me == 0 ? 0 : before;
}

void EngineRanks::begin_any(unsigned bits) const {
  asked_ = bits;
  answer_ = bits;
  if (count > 1) MPI_Iallreduce(&asked_, &answer_, 1, MPI_UNSIGNED, MPI_BOR, world, &asking_);
}

unsigned EngineRanks::end_any() const {
  MPI_Wait(&asking_, MPI_STATUS_IGNORE);
  return std::exchange(answer_, 0u);
}

void EngineRanks::forget_sent() const {
  for (auto m = sent_.begin(); m != sent_.end();) {
    int done = 0;
    MPI_Test(&m->request, &done, MPI_STATUS_IGNORE);
    m = done ? sent_.erase(m) : std::next(m);
  }
}

void EngineRanks::send(int rank, const void* bytes, std::size_t n) const {
  forget_sent();
  const char* const from = static_cast<const char*>(bytes);
  sent_.push_back({std::vector<char>(from, from + n), MPI_REQUEST_NULL});
  // as words, so that messages may be larger than 2 GiB; what is left over of the last one is sent along
  Message& m = sent_.back();
  const std::size_t words = n / sizeof(double) + 1;
  m.bytes.resize(words * sizeof(double));
  m.bytes.back() = static_cast<char>(words * sizeof(double) - n);
  MPI_Isend(m.bytes.data(), static_cast<int>(words), MPI_DOUBLE, rank, message_tag, world, &m.request);
}

std::vector<char> EngineRanks::receive(int rank) const {
  MPI_Status status;
  MPI_Probe(rank, message_tag, world, &status);
  int words = 0;
  MPI_Get_count(&status, MPI_DOUBLE, &words);
  std::vector<char> bytes(static_cast<std::size_t>(words) * sizeof(double));
  MPI_Recv(bytes.data(), words, MPI_DOUBLE, rank, message_tag, world, MPI_STATUS_IGNORE);
  bytes.resize(bytes.size() - static_cast<unsigned char>(bytes.back()));
  return bytes;
}

void EngineRanks::follow_box() {
  constexpr int shrink_wrapped = 2;  // of Domain::nonperiodic
  if (count > 1 && domain->nonperiodic == shrink_wrapped) domain->reset_box();
}

/// As every rank knows it: no message is needed. A side of the box that is not periodic may follow the granules, and the rank at
/// it owns what lies beyond.
RankGrid EngineRanks::grid() const {
  constexpr double no_border = std::numeric_limits<double>::infinity();
  const double* const splits[3] = {comm->xsplit, comm->ysplit, comm->zsplit};
  RankGrid g;
  for (int d = 0; d < 3; ++d) {
    const int cells = comm->procgrid[d];
    const bool periodic = domain->boundary[d][0] == 0;
    for (int c = 0; c < cells; ++c) g.cuts[d].push_back(domain->boxlo[d] + splits[d][c] * domain->prd[d]);
    g.cuts[d].push_back(domain->boxhi[d]);
    if (periodic) {
      g.periods[d] = domain->prd[d];
    } else {
      g.cuts[d].front() = -no_border;
      g.cuts[d].back() = no_border;
    }
  }
  return g;
}

auto EngineRanks::partners(double reach) const -> const std::vector<Partner>& {
  const auto known = partners_.find(reach);
  if (known != partners_.end()) return known->second;
  std::vector<Partner> found;
  for (const RankGrid::Partner& p : grid_.around({comm->myloc[0], comm->myloc[1], comm->myloc[2]}, reach))
    found.push_back({p, comm->grid2proc[p.cell[0]][p.cell[1]][p.cell[2]]});
  std::sort(found.begin(), found.end(), [](const Partner& a, const Partner& b) { return a.rank < b.rank; });
  return partners_[reach] = std::move(found);
}

void EngineRanks::update() {
  grid_ = grid();
  const RankGrid::Cell own{comm->myloc[0], comm->myloc[1], comm->myloc[2]};
  lo_ = grid_.lo(own);
  hi_ = grid_.hi(own);
  partners_.clear();

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

bool EngineRanks::subdomains_changed() const {
  const RankGrid now = grid();
  return now.cuts != grid_.cuts || now.periods != grid_.periods;
}

RankGrid::Cell EngineRanks::cell_of(const Vec3& place) const {
  double x[3];
  set(x, place);
  domain->remap(x);
  return grid_.cell_of(vec(x));
}

int EngineRanks::owner(const Vec3& place) const {
  const RankGrid::Cell cell = cell_of(place);
  return comm->grid2proc[cell[0]][cell[1]][cell[2]];
}

bool EngineRanks::brings_home(const Vec3& place) const {
  const bool here = (place.array() >= lo_.array()).all() && (place.array() < hi_.array()).all();
  return here || grid_.are_neighbours({comm->myloc[0], comm->myloc[1], comm->myloc[2]}, cell_of(place));
}

Box EngineRanks::own() const { return {vec(domain->sublo), vec(domain->subhi)}; }

std::array<std::vector<double>, 3> EngineRanks::cuts() const {
  std::array<std::vector<double>, 3> all = grid().cuts;
  for (int d = 0; d < 3; ++d) {
    all[d].front() = domain->boxlo[d];
    all[d].back() = domain->boxhi[d];
  }
  return all;
}

/// Ghosts come from neighbours alone.
double EngineRanks::thinnest() const { return neighbor->cutneighmax + 2 * neighbor->skin; }

/// LIGGGHTS keeps them as shares of the box.
void EngineRanks::move_cuts(const std::array<std::vector<double>, 3>& to) {
  double* const splits[3] = {comm->xsplit, comm->ysplit, comm->zsplit};
  for (int d = 0; d < 3; ++d)
    for (int c = 1; c < comm->procgrid[d]; ++c)
      splits[d][c] = (to[d][static_cast<std::size_t>(c)] - domain->boxlo[d]) / domain->prd[d];
  comm->uniform = 0;
  domain->set_local_box();
}

int EngineRanks::hops() const { return comm->procgrid[0] + comm->procgrid[1] + comm->procgrid[2] - 3; }

/// Atoms hardly leave their subdomain between two builds; what comes out of a store, or a deck has moved, may be anywhere.
bool EngineRanks::is_far_out(const Vec3& place) const {
  const double slack = neighbor->cutneighmax;
  return count > 1 && ((place.array() < lo_.array() - slack).any() || (place.array() > hi_.array() + slack).any());
}

/// Between two builds an atom may go farther, as where a fix drives it: whom it comes near has no ghost of it either.
auto EngineRanks::partners_within(double width) const -> const std::vector<Partner>& {
  return partners(far_out_ ? std::numeric_limits<double>::infinity() : width + neighbor->cutneighmax);
}

std::vector<int> EngineRanks::neighbours(double width) const {
  std::vector<int> ranks;
  for (const Partner& p : partners_within(width))
    if (p.rank != me) ranks.push_back(p.rank);
  return ranks;
}

void EngineRanks::exchange_bytes(const void* rows, std::size_t n, std::size_t bytes, double width, const Room& room) const {
  const char* const from = static_cast<const char*>(rows);
  // most rows are farther than the width from all borders of this subdomain
  const double rounding = 1e-6 * width;
  const auto is_near_a_border = [&](const Triple& at) {
    for (int d = 0; d < 3; ++d)
      if (at[d] <= lo_[d] + width + rounding || at[d] >= hi_[d] - width - rounding) return true;
    return false;
  };
  struct Row {
    std::size_t number;
    Triple at;
  };
  std::vector<Row> near_borders;
  for (std::size_t r = 0; r < n; ++r) {
    Row row{r, {}};
    std::memcpy(row.at.data(), from + r * bytes, sizeof row.at);
    if (!is_near_a_border(row.at)) continue;
    near_borders.push_back(row);
  }
  const std::vector<Partner>& all = partners_within(width);
  std::vector<std::vector<char>> out(all.size());
  for (std::size_t p = 0; p < all.size(); ++p)
    for (const Vec3& shift : all[p].shifts)
      for (const Row& row : near_borders) {
        Triple at = row.at;
        bool near = true;
        for (int d = 0; d < 3; ++d) {
          at[d] += shift[d];
          near = near && !(at[d] < all[p].lo[d] - width || at[d] > all[p].hi[d] + width);
        }
        if (!near) continue;
        const std::size_t place = out[p].size();
        out[p].insert(out[p].end(), from + row.number * bytes, from + (row.number + 1) * bytes);
        std::memcpy(&out[p][place], at.data(), sizeof at);
      }
  const RowType row(bytes);
  std::vector<MPI_Request> sent;
  for (std::size_t p = 0; p < all.size(); ++p)
    if (all[p].rank != me) {
      sent.emplace_back();
      MPI_Isend(out[p].data(), static_cast<int>(out[p].size() / bytes), row, all[p].rank, exchange_tag, world, &sent.back());
    }
  std::vector<int> comes(all.size());
  std::size_t total = 0;
  for (std::size_t p = 0; p < all.size(); ++p) {
    if (all[p].rank == me) {
      comes[p] = static_cast<int>(out[p].size() / bytes);
    } else {
      MPI_Status status;
      MPI_Probe(all[p].rank, exchange_tag, world, &status);
      MPI_Get_count(&status, row, &comes[p]);
    }
    total += static_cast<std::size_t>(comes[p]);
  }
  char* to = static_cast<char*>(room(total));
  for (std::size_t p = 0; p < all.size(); ++p) {
    if (all[p].rank == me)
      std::copy(out[p].begin(), out[p].end(), to);
    else
      MPI_Recv(to, comes[p], row, all[p].rank, exchange_tag, world, MPI_STATUS_IGNORE);
    to += static_cast<std::size_t>(comes[p]) * bytes;
  }
  MPI_Waitall(static_cast<int>(sent.size()), sent.data(), MPI_STATUSES_IGNORE);
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

/// Nobody knows from whom letters come, or how many: who has sent all his, and they were taken, comes to the barrier, and takes
/// letters until all have come. So nothing is as long as there are ranks. A rank may be one delivery ahead of another: tags go by
/// turns.
void EngineRanks::deliver_bytes(const std::vector<Letter>& letters, std::size_t bytes, const RoomFrom& room) const {
  const int tag = delivery_tag + (deliveries_++ & 1);
  const RowType row(bytes);
  std::vector<MPI_Request> sent;
  for (const Letter& l : letters) {
    if (l.to == me) {
      std::memcpy(room(me, l.n), l.rows, l.n * bytes);
      continue;
    }
    if (l.n > static_cast<std::size_t>(std::numeric_limits<int>::max()))
      throw InternalError("a letter to another rank has " + std::to_string(l.n) + " rows");
    sent.emplace_back();
    MPI_Issend(l.rows, static_cast<int>(l.n), row, l.to, tag, world, &sent.back());
  }
  if (count == 1) return;
  MPI_Request all_came = MPI_REQUEST_NULL;
  for (int done = 0; !done;) {
    int there = 0;
    MPI_Status status;
    MPI_Iprobe(MPI_ANY_SOURCE, tag, world, &there, &status);
    if (there) {
      int n = 0;
      MPI_Get_count(&status, row, &n);
      MPI_Recv(room(status.MPI_SOURCE, static_cast<std::size_t>(n)), n, row, status.MPI_SOURCE, tag, world, MPI_STATUS_IGNORE);
    } else if (all_came != MPI_REQUEST_NULL) {
      MPI_Test(&all_came, &done, MPI_STATUS_IGNORE);
    } else {
      int taken = 0;
      MPI_Testall(static_cast<int>(sent.size()), sent.data(), &taken, MPI_STATUSES_IGNORE);
      if (taken) MPI_Ibarrier(world, &all_came);
    }
  }
}

std::unique_ptr<SharedFile> EngineRanks::open_to_write(const std::string& file) const {
  if (count == 1) return std::make_unique<OneRanksFile>(file);
  return std::make_unique<MpiFile>(world, file);
}

}  // namespace solidcull
