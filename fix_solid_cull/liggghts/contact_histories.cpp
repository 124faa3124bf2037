#include "contact_histories.h"

#include <cstring>
#include <string>

#include "atom.h"
#include "engine_access.h"
#include "fix_contact_history.h"
#include "modify.h"

namespace solidcull {

void ContactHistories::connect() {
  fix_ = static_cast<LAMMPS_NS::FixContactHistory*>(modify->find_fix_style_strict("contacthistory", 0));
}

std::vector<bool> ContactHistories::flips() const {
  std::vector<bool> f;
  if (!fix_) return f;
  const int* newton = engine::history_newton_flags(*fix_);
  for (int d = 0; d < fix_->get_dnum(); ++d) f.push_back(newton[d] != 0);
  return f;
}

std::vector<int> ContactHistories::vectors() const {
  std::vector<int> firsts;
  if (!fix_) return firsts;
  const int width = fix_->get_dnum();
  for (int d = 0; d + 2 < width; ++d) {
    const std::string name = engine::history_name(*fix_, d);
    for (const char* ends : {"xyz", "012"}) {
      // epsd and epsd2 say "r_torquex_old"
      const std::size_t at = name.find_last_of(ends[0]);
      if (at == std::string::npos) continue;
      std::string second = name, third = name;
      second[at] = ends[1];
      third[at] = ends[2];
      const std::string after = engine::history_name(*fix_, d + 2);
      if (engine::history_name(*fix_, d + 1) != second || (after != third && after != second)) continue;  // luding says y twice
      firsts.push_back(d);
      d += 2;
      break;
    }
  }
  return firsts;
}

void ContactHistories::bring_up_to_date() {
  for (int i = 0; i < modify->nfix; ++i)
    if (std::strncmp(modify->fix[i]->style, "contacthistory", 14) == 0) modify->fix[i]->setup_pre_exchange();
}

HistoryRows ContactHistories::rows() const {
  if (!fix_) return {};
  return {engine::history_counts(*fix_), engine::history_partners(*fix_), engine::history_numbers(*fix_), fix_->get_dnum()};
}

void ContactHistories::clear(int granule) {
  if (!fix_) return;
  double none = LAMMPS_NS::Fix::ubuf(0).d;
  fix_->unpack_exchange(granule, &none);
}

void ContactHistories::give(int granule, const Contacts::History* contacts, std::size_t n) {
  if (!fix_) return;
  const int width = fix_->get_dnum(), before = fix_->n_partner(granule);
  const auto integer = [](std::int64_t i) { return LAMMPS_NS::Fix::ubuf(i).d; };
  std::int64_t count = 0;
  buffer_.assign(1, 0);
  const auto add = [&](std::int64_t partner, const double* history) {
    ++count;
    buffer_.push_back(integer(partner));
    buffer_.insert(buffer_.end(), history, history + width);
  };
  for (int k = 0; k < before; ++k) add(fix_->partner(granule, k), fix_->contacthistory(granule, k));
  for (const Contacts::History* c = contacts; c != contacts + n; ++c) {
    int k = 0;
    while (k < before && fix_->partner(granule, k) != c->partner) ++k;
    if (k == before) add(c->partner, c->numbers);
  }
  buffer_.front() = integer(count);
  fix_->unpack_exchange(granule, buffer_.data());
}

}  // namespace solidcull
