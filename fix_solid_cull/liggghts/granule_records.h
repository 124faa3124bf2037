// A granule as the engine packs it: every per-atom array of the atom style and of every fix, column by column, so that a granule
// can come back into a deck whose fixes have changed meanwhile.
#pragma once

#include <string>
#include <vector>

#include "fix.h"
#include "pointers.h"

namespace solidcull {

/// Local to the rank. Only to be used where atoms may be made and deleted (pre_exchange, or between runs).
class GranuleRecords : protected LAMMPS_NS::Pointers {
 public:
  /// own: the fix whose columns are not packed, because the granule's place in the fix changes.
  GranuleRecords(LAMMPS_NS::LAMMPS* lmp, const LAMMPS_NS::Fix* own) : Pointers(lmp), own_(own) {}

  /// Packs owned granule i; `layout` receives the number of its column layout.
  void pack(int i, std::vector<double>& record, int& layout);
  /// Which numbers of a record are position, velocity and spin (position only where `positions`), by trying them on owned granule
  /// i.
  std::vector<int> motion_words(int i, bool positions, bool spins);
  /// Which number of a record is the granule's groups, likewise; and such a number as it is packed.
  int groups_word(int i);
  static int whole_number(double packed);
  /// Deletes owned granule i; the last owned granule takes its index, and its row is as if no granule had been there.
  void remove(int i);
  /// Appends a granule from its record and returns its index. Fixes that were not there when it was packed set their defaults.
  int append(const std::vector<double>& record, int layout);

  /// A column layout as text, and the other way, for restart files. `layout` may return an existing number.
  std::string layout_text(int layout) const;
  int layout_from_text(const std::string& text);
  int layouts() const { return static_cast<int>(layouts_.size()); }

 private:
  struct Column {
    std::string fix;  // its ID; empty: the atom style's own
    int length;
    bool operator==(const Column& o) const { return fix == o.fix && length == o.length; }
  };
  using Layout = std::vector<Column>;
  int number_of(const Layout& layout);
  bool is_last_layout() const;
  void blank(int row);

  const LAMMPS_NS::Fix* own_;
  std::vector<Layout> layouts_;
  int last_layout_ = -1;
  std::vector<int> lengths_;
  std::vector<double> packed_, unpacked_, zeros_;  // of one granule
};

}  // namespace solidcull
