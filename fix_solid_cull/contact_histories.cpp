#include "contact_histories.h"

#include <algorithm>
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

int ContactHistories::partners(int granule) const { return fix_ ? fix_->n_partner(granule) : 0; }
int ContactHistories::partner(int granule, int k) const { return fix_->partner(granule, k); }
const double* ContactHistories::history(int granule, int k) const { return fix_->contacthistory(granule, k); }

void ContactHistories::give(int granule, const std::vector<Contact>& contacts) {
  if (!fix_) return;
  const std::size_t width = static_cast<std::size_t>(fix_->get_dnum());
  std::vector<Contact> all;
  for_each_partner(granule, [&](int p, const double* h) { all.push_back({p, std::vector<double>(h, h + width)}); });
  for (const Contact& c : contacts)
    if (std::none_of(all.begin(), all.end(), [&](const Contact& has) { return has.partner == c.partner; })) all.push_back(c);
  write(granule, all);
}

void ContactHistories::write(int granule, const std::vector<Contact>& contacts) {
  if (!fix_) return;
  std::vector<double> buffer;
  const auto integer = [](std::int64_t i) { return LAMMPS_NS::Fix::ubuf(i).d; };
  buffer.push_back(integer(static_cast<std::int64_t>(contacts.size())));
  for (const Contact& c : contacts) {
    buffer.push_back(integer(c.partner));
    buffer.insert(buffer.end(), c.history.begin(), c.history.end());
  }
  fix_->unpack_exchange(granule, buffer.data());
}

}  // namespace solidcull
