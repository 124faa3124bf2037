#include "snapshot.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <string>

#include "input_error.h"
#include "word_sum.h"

namespace solidcull {
namespace {

constexpr double file_mark = 20261126;  // the format's version
/// The numbers before the ranks' parcels. A check sum follows them.
enum Header {
  mark,
  size_again,
  interior,
  diameter,
  gravity,
  gravity_x,
  counters = gravity_x + 3,
  width = counters + Ledger::counters_size,
  ranks,
  step,
  no_places,
  header_size
};
constexpr std::size_t check_sum_size = 2;

/// In two halves that doubles hold exactly.
std::array<double, check_sum_size> check_sum(const double* numbers, std::size_t n) {
  WordSum sum;
  for (std::size_t k = 0; k < n; ++k) sum.add(numbers[k]);
  return {static_cast<double>(sum.value() >> 32), static_cast<double>(sum.value() & 0xffffffffu)};
}

constexpr const char* damaged = "the restart file is damaged where it holds this fix's granules: use another one";

}  // namespace

std::vector<double> Snapshot::write() {
  std::vector<std::int64_t> stored, interface_tags;
  std::vector<double> mine;
  index_.index(ports_.atoms);
  if (solid_.has_store()) {
    solid_.store().for_each([&](const Resident& g) { stored.push_back(g.tag); });
    std::sort(stored.begin(), stored.end());
    for (int i = 0; i < ports_.atoms.owned; ++i)
      if (shell_[i].locked) interface_tags.push_back(ports_.atoms.tag[i]);
    mine = parcels_.pack(stored, interface_tags, true);
  }
  Ledger::Counters sums = solid_.ledger().counters();
  const double carves = sums[Ledger::carves_counter];
  ports_.ranks.sum(sums.data(), Ledger::counters_size);
  sums[Ledger::carves_counter] = carves;
  std::int64_t in_file[2] = {static_cast<std::int64_t>(mine.size()), static_cast<std::int64_t>(stored.size())};
  ports_.ranks.sum(in_file, 2);
  const std::int64_t size = in_file[0] + 1 + header_size + static_cast<std::int64_t>(check_sum_size);
  constexpr std::int64_t bytes = sizeof(double), gib = std::int64_t{1} << 30;
  if (size * bytes > INT32_MAX)
    throw InputError("the store needs " + std::to_string(size * bytes / gib + 1) +
                     " GiB and LIGGGHTS's restart format holds 2 GiB for a fix: unfix " + ports_.run.name +
                     " before write_restart");
  std::vector<double> all = ports_.ranks.gather_on_root(mine);
  if (ports_.ranks.me != 0) return {};
  std::vector<double> state(1 + header_size);
  state[0] = static_cast<double>(size);
  double* const h = &state[1];
  h[mark] = file_mark;
  h[size_again] = state[0];
  h[interior] = static_cast<double>(in_file[1]);
  h[diameter] = scales_.diameter();
  h[gravity] = scales_.gravity();
  set(h + gravity_x, gravity_.at_last_look());
  std::copy(sums.begin(), sums.end(), h + counters);
  h[width] = static_cast<double>(solid_.contacts().width());
  h[ranks] = ports_.ranks.count;
  h[step] = static_cast<double>(ports_.run.step);
  h[no_places] = scales_.refills();
  state.reserve(static_cast<std::size_t>(size));
  state.insert(state.end(), all.begin(), all.end());
  const auto sum = check_sum(state.data(), state.size());
  state.insert(state.end(), sum.begin(), sum.end());
  return state;
}

std::vector<double> Snapshot::from_bytes(const char* bytes) {
  std::vector<double> state(1 + header_size);
  std::memcpy(state.data(), bytes, state.size() * sizeof(double));
  if (state[1 + mark] != file_mark)
    throw InputError("the restart file was written by another version of solidcull: write it again with this one");
  const double n = state[0];
  if (!(n >= 1 + header_size + check_sum_size && n <= INT32_MAX / sizeof(double)) || state[1 + size_again] != n)
    throw InputError(damaged);
  state.resize(static_cast<std::size_t>(n));
  std::memcpy(state.data(), bytes, state.size() * sizeof(double));
  const std::size_t size = state.size() - check_sum_size;
  const auto sum = check_sum(state.data(), size);
  if (!std::equal(sum.begin(), sum.end(), state.begin() + static_cast<std::ptrdiff_t>(size))) throw InputError(damaged);
  return state;
}

std::int64_t Snapshot::interior_of(const std::vector<double>& state) { return static_cast<std::int64_t>(state[1 + interior]); }

void Snapshot::read(const std::vector<double>& state) {
  state_.assign(state.begin() + 1, state.end() - check_sum_size);
  const double* const h = state_.data();
  scales_.set(h[diameter], h[gravity]);
  gravity_.set_at_last_look(vec(h + gravity_x));
  const std::int64_t then = static_cast<std::int64_t>(h[step]);
  ports_.run.reset_by += ports_.run.step - then;
  ports_.run.step = then;
  Ledger::Counters counted{};
  for (int k = 0; k < Ledger::counters_size; ++k)
    if (ports_.ranks.me == 0 || k == Ledger::carves_counter) counted[k] = h[counters + k];
  solid_.set_counters(counted);

  // the neighbour cut-off is set before the store is taken up: it must know the largest stored radius
  for (const Parcel& p : parcels_.unpack(h + header_size, state_.size() - header_size, static_cast<std::size_t>(h[width])))
    for (const auto& g : p.granules)
      if (g.second.record) solid_.know_radius(g.second.stored.type, g.second.radius);
}

void Snapshot::take_up() {
  const std::vector<double> state = std::move(state_);
  state_.clear();
  const double* const h = state.data();
  if (static_cast<std::size_t>(h[width]) != solid_.contacts().width())
    throw InputError("the restart file holds contact histories of " + std::to_string(static_cast<int>(h[width])) +
                     " numbers and this deck's contact model has " + std::to_string(solid_.contacts().width()) +
                     ": use the contact model that the file was written with");
  if ((h[no_places] != 0) != scales_.refills() && h[interior] > 0)
    throw InputError(std::string("the restart file was written with 'store ") +
                     (scales_.refills() ? "exact' or 'compact" : "none") + "': read it with that store");
  index_.index(ports_.atoms);
  const std::vector<Parcel> parcels = parcels_.unpack(h + header_size, state.size() - header_size, solid_.contacts().width());
  const bool same_ranks =
      static_cast<int>(h[ranks]) == ports_.ranks.count && static_cast<int>(parcels.size()) == ports_.ranks.count;
  if (same_ranks && !ports_.ranks.any(!parcels_.is_whole_rank(parcels[ports_.ranks.me])))
    parcels_.take_up_as_it_was(parcels[ports_.ranks.me]);
  else
    parcels_.take_up(parcels);
}

}  // namespace solidcull
