#include "granule_records.h"

#include <algorithm>
#include <cstdint>
#include <sstream>

#include "atom.h"
#include "atom_vec.h"
#include "bits.h"
#include "fix.h"
#include "internal_error.h"
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
  packed_.resize(longest_column);
  record.clear();
  lengths_.clear();
  const auto keep = [&](int length) {
    lengths_.push_back(length);
    record.insert(record.end(), packed_.begin(), packed_.begin() + length);
  };
  {
    AtomStyleOnly guard(atom);
    keep(atom->avec->pack_exchange(i, packed_.data()));
  }
  for (int e = 0; e < atom->nextra_grow; ++e) {
    LAMMPS_NS::Fix* fix = modify->fix[atom->extra_grow[e]];
    if (fix != own_) keep(fix->pack_exchange(i, packed_.data()));
  }
  layout = last_layout_;
  if (!is_last_layout()) {
    Layout columns = {{"", lengths_[0]}};
    std::size_t column = 1;
    for (int e = 0; e < atom->nextra_grow; ++e) {
      LAMMPS_NS::Fix* fix = modify->fix[atom->extra_grow[e]];
      if (fix != own_) columns.push_back({fix->id, lengths_[column++]});
    }
    layout = last_layout_ = number_of(columns);
  }
}

/// Most granules have the columns of the one before.
bool GranuleRecords::is_last_layout() const {
  if (last_layout_ < 0) return false;
  const Layout& last = layouts_[last_layout_];
  if (last.size() != lengths_.size() || last[0].length != lengths_[0]) return false;
  std::size_t column = 1;
  for (int e = 0; e < atom->nextra_grow; ++e) {
    const LAMMPS_NS::Fix* fix = modify->fix[atom->extra_grow[e]];
    if (fix == own_) continue;
    if (last[column].length != lengths_[column] || last[column].fix != fix->id) return false;
    ++column;
  }
  return true;
}

std::vector<int> GranuleRecords::motion_words(int i, bool positions, bool spins) {
  std::vector<double> before(longest_column), after(longest_column);
  AtomStyleOnly guard(atom);
  const int length = atom->avec->pack_exchange(i, before.data());
  std::vector<double*> state;
  for (int d = 0; d < 3; ++d) {
    if (positions) state.push_back(&atom->x[i][d]);
    state.push_back(&atom->v[i][d]);
    if (spins) state.push_back(&atom->omega[i][d]);
  }
  std::vector<int> words;
  for (double* number : state) {
    const double kept = *number;
    *number = kept + 1;
    atom->avec->pack_exchange(i, after.data());
    *number = kept;
    for (int w = 0; w < length; ++w)
      if (bits_of(before[w]) != bits_of(after[w])) words.push_back(w);
  }
  std::sort(words.begin(), words.end());
  return words;
}

int GranuleRecords::groups_word(int i) {
  std::vector<double> packed(longest_column);
  AtomStyleOnly guard(atom);
  constexpr int unlikely = 0x35a9c6e3;
  const int kept = atom->mask[i];
  atom->mask[i] = unlikely;
  const int length = atom->avec->pack_exchange(i, packed.data());
  atom->mask[i] = kept;
  for (int w = 0; w < length; ++w)
    if (whole_number(packed[static_cast<std::size_t>(w)]) == unlikely) return w;
  throw InternalError("the groups of a granule do not stand in its record");
}

/// The engine packs whole numbers by their bits.
int GranuleRecords::whole_number(double packed) { return static_cast<int>(bits_of(packed)); }

void GranuleRecords::remove(int i) {
  if (i != atom->nlocal - 1) atom->avec->copy(atom->nlocal - 1, i, 1);
  atom->nlocal--;
  blank(atom->nlocal);
}

/// What the engine sets for no new granule is zero in rows that never had one: forces, and columns of fixes without defaults.
void GranuleRecords::blank(int row) {
  std::fill_n(atom->f[row], 3, 0.0);
  std::fill_n(atom->torque[row], 3, 0.0);
  for (int e = 0; e < atom->nextra_grow; ++e) {
    LAMMPS_NS::Fix* fix = modify->fix[atom->extra_grow[e]];
    if (fix == own_ || fix->create_attribute) continue;
    if (zeros_.empty()) zeros_.resize(longest_column);
    fix->unpack_exchange(row, zeros_.data());
  }
}

int GranuleRecords::append(const std::vector<double>& record, int layout) {
  const int i = atom->nlocal;
  if (i == atom->nmax) atom->avec->grow(0);
  unpacked_.assign(record.begin(), record.end());
  const Layout& columns = layouts_[layout];
  {
    AtomStyleOnly guard(atom);
    atom->avec->unpack_exchange(unpacked_.data());
  }
  auto next = columns.begin() + 1;
  int next_at = columns.front().length;
  for (int e = 0; e < atom->nextra_grow; ++e) {
    LAMMPS_NS::Fix* fix = modify->fix[atom->extra_grow[e]];
    if (next != columns.end() && next->fix == fix->id) {  // as a rule columns stand in the order of fixes
      fix->unpack_exchange(i, &unpacked_[next_at]);
      next_at += (next++)->length;
      continue;
    }
    int at = columns.front().length;
    auto column = columns.begin() + 1;
    while (column != columns.end() && column->fix != fix->id) at += (column++)->length;
    if (column != columns.end())
      fix->unpack_exchange(i, &unpacked_[at]);
    else
      fix->set_arrays(i);
  }
  std::fill_n(atom->f[i], 3, 0.0);
  std::fill_n(atom->torque[i], 3, 0.0);
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
