#include "granule_store.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "exact_sum.h"

namespace solidcull {

GranuleStore::GranuleStore(double cell) : inverse_cell_(1.0 / cell) {
  if (!(cell > 0) || !std::isfinite(cell)) throw std::invalid_argument("granule store: the cell size must be positive");
}

void GranuleStore::count_around(Grid& grid, const std::array<std::int64_t, 3>& c, int change) {
  for (std::int64_t i = c[0] - 1; i <= c[0] + 1; ++i)
    for (std::int64_t j = c[1] - 1; j <= c[1] + 1; ++j)
      for (std::int64_t k = c[2] - 1; k <= c[2] + 1; ++k) {
        Cell& cell = grid.cells[key(i, j, k)];
        cell.count_around += change;
        if (cell.count_around == 0) grid.cells.erase(key(i, j, k));
      }
}

void GranuleStore::link(int s) {
  const StoredGranule& granule = slots_[s].granule;
  Grid& grid = grids_[granule.body];
  const auto c = cell_of(granule.position);
  count_around(grid, c, +1);
  Cell& cell = grid.cells[key(c[0], c[1], c[2])];
  slots_[s].next = cell.head;
  cell.head = s;
  ++cell.count_here;
  ++grid.granules;
  grid.lo = grid.lo.cwiseMin(granule.position);
  grid.hi = grid.hi.cwiseMax(granule.position);
}

void GranuleStore::unlink(int s) {
  const StoredGranule& granule = slots_[s].granule;
  const auto grid = grids_.find(granule.body);
  const auto c = cell_of(granule.position);
  Cell& cell = *grid->second.cells.find(key(c[0], c[1], c[2]));
  int* link = &cell.head;
  while (*link != s) link = &slots_[*link].next;
  *link = slots_[s].next;
  --cell.count_here;
  count_around(grid->second, c, -1);
  if (--grid->second.granules == 0) grids_.erase(grid);
}

void GranuleStore::move(std::int64_t tag, int body, const Vec3& position) {
  const int* s = slot_of_.find(tag);
  if (!s) throw std::logic_error("granule " + std::to_string(tag) + " is not in the store");
  unlink(*s);
  slots_[*s].granule.body = body;
  slots_[*s].granule.position = position;
  link(*s);
}

void GranuleStore::add(const StoredGranule& granule, const double* record, int length) {
  if (slot_of_.contains(granule.tag))
    throw std::logic_error("granule " + std::to_string(granule.tag) + " went into the store twice");
  int s = first_free_;
  if (s == none) {
    s = static_cast<int>(slots_.size());
    slots_.emplace_back();
  } else {
    first_free_ = slots_[s].next;
  }
  if (static_cast<std::size_t>(length) >= pools_.size()) pools_.resize(length + 1);
  Pool& pool = pools_[length];
  std::size_t offset = pool.data.size();
  if (pool.free.empty()) {
    pool.data.insert(pool.data.end(), record, record + length);
  } else {
    offset = pool.free.back();
    pool.free.pop_back();
    std::copy(record, record + length, pool.data.begin() + static_cast<std::ptrdiff_t>(offset));
  }

  slots_[s] = {granule, offset, length, none};
  link(s);
  slot_of_[granule.tag] = s;
  largest_radius_ = std::max(largest_radius_, granule.radius);
}

StoredGranule GranuleStore::take(std::int64_t tag, std::vector<double>& record) {
  const int* found = slot_of_.find(tag);
  if (!found) throw std::logic_error("granule " + std::to_string(tag) + " is not in the store");
  const int s = *found;
  Slot& slot = slots_[s];
  Pool& pool = pools_[slot.length];
  const auto from = pool.data.begin() + static_cast<std::ptrdiff_t>(slot.offset);
  record.assign(from, from + slot.length);
  pool.free.push_back(slot.offset);

  unlink(s);

  slot_of_.erase(tag);
  slot.next = first_free_;
  first_free_ = s;
  return slot.granule;
}

const StoredGranule* GranuleStore::find(std::int64_t tag) const {
  const int* s = slot_of_.find(tag);
  return s ? &slots_[*s].granule : nullptr;
}

const double* GranuleStore::record(std::int64_t tag, int& length) const {
  const int* s = slot_of_.find(tag);
  if (!s) throw std::logic_error("granule " + std::to_string(tag) + " is not in the store");
  length = slots_[*s].length;
  return pools_[length].data.data() + slots_[*s].offset;
}

double GranuleStore::mass() const {
  ExactSum sum;
  for_each([&](const StoredGranule& g) { sum += g.mass; });
  return sum.value();
}

std::size_t GranuleStore::memory_bytes() const {
  std::size_t bytes = slots_.capacity() * sizeof(Slot) + slot_of_.memory_bytes();
  for (const auto& grid : grids_) bytes += sizeof(Grid) + grid.second.cells.memory_bytes();
  for (const Pool& p : pools_) bytes += p.data.capacity() * sizeof(double) + p.free.capacity() * sizeof(std::size_t);
  return bytes;
}

}  // namespace solidcull
