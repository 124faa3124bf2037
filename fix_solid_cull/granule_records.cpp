#include "granule_records.h"

#include <algorithm>
#include <sstream>

#include "atom.h"
#include "atom_vec.h"
#include "fix.h"
#include "modify.h"

namespace solidcull {
namespace {

/// AtomVec packs its own columns and then every fix's; with no fixes named it packs its own alone.
class AtomStyleOnly {
 public:
  explicit AtomStyleOnly(LAMMPS_NS::Atom* atom) : atom_(atom), fixes_(atom->nextra_grow) { atom->nextra_grow = 0; }
  ~AtomStyleOnly() { atom_->nextra_grow = fixes_; }

 private:
  LAMMPS_NS::Atom* atom_;
  int fixes_;
};

constexpr std::size_t longest_column = 1 << 16;  // doubles; far above BUFEXTRA, the engine's own bound for one atom

}  // namespace

int GranuleRecords::number_of(const Layout& layout) {
  const auto found = std::find(layouts_.begin(), layouts_.end(), layout);
  if (found != layouts_.end()) return static_cast<int>(found - layouts_.begin());
  layouts_.push_back(layout);
  return layouts() - 1;
}

void GranuleRecords::pack(int i, std::vector<double>& record, int& layout) {
  scratch_.resize(longest_column);
  record.clear();
  Layout columns;
  const auto keep = [&](const std::string& fix, int length) {
    columns.push_back({fix, length});
    record.insert(record.end(), scratch_.begin(), scratch_.begin() + length);
  };
  {
    AtomStyleOnly guard(atom);
    keep("", atom->avec->pack_exchange(i, scratch_.data()));
  }
  for (int e = 0; e < atom->nextra_grow; ++e) {
    LAMMPS_NS::Fix* fix = modify->fix[atom->extra_grow[e]];
    if (fix != own_) keep(fix->id, fix->pack_exchange(i, scratch_.data()));
  }
  layout = number_of(columns);
}

void GranuleRecords::remove(int i) {
  atom->avec->copy(atom->nlocal - 1, i, 1);
  atom->nlocal--;
}

int GranuleRecords::append(const std::vector<double>& record, int layout) {
  const int i = atom->nlocal;
  if (i == atom->nmax) atom->avec->grow(0);
  scratch_.assign(record.begin(), record.end());
  const Layout& columns = layouts_[layout];
  {
    AtomStyleOnly guard(atom);
    atom->avec->unpack_exchange(scratch_.data());
  }
  for (int e = 0; e < atom->nextra_grow; ++e) {
    LAMMPS_NS::Fix* fix = modify->fix[atom->extra_grow[e]];
    int at = columns.front().length;
    auto column = columns.begin() + 1;
    while (column != columns.end() && column->fix != fix->id) at += (column++)->length;
    if (column != columns.end())
      fix->unpack_exchange(i, &scratch_[at]);
    else
      fix->set_arrays(i);
  }
  for (int d = 0; d < 3; ++d) {
    atom->f[i][d] = 0;
    atom->torque[i][d] = 0;
  }
  return i;
}

std::string GranuleRecords::layout_text(int layout) const {
  std::ostringstream text;
  for (const Column& c : layouts_[layout]) text << (c.fix.empty() ? "-" : c.fix) << ' ' << c.length << ' ';
  return text.str();
}

int GranuleRecords::layout_from_text(const std::string& text) {
  std::istringstream in(text);
  Layout columns;
  Column c;
  while (in >> c.fix >> c.length) {
    if (c.fix == "-") c.fix.clear();
    columns.push_back(c);
  }
  return number_of(columns);
}

}  // namespace solidcull
