// LIGGGHTS's atoms as the culling sees them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fix.h"
#include "granule_records.h"
#include "pointers.h"
#include "ports.h"

namespace solidcull {

/// The ID of the fix that keeps when granules of fix insert/stream are released.
constexpr const char* releases_id = "release_fix_insert_stream";

class EngineAtoms : public Atoms, protected LAMMPS_NS::Pointers {
 public:
  /// own: the culling's fix, whose group and per-atom arrays are its own matter.
  EngineAtoms(LAMMPS_NS::LAMMPS* lmp, const LAMMPS_NS::Fix* own);

  /// The engine's arrays may be others: reads them anew. At each hook. Local.
  void renew();
  /// A run begins: fixes may be others. Local.
  void connect();
  /// An atom that is made now comes out of a record.
  bool puts_back() const { return puts_back_; }
  /// Makes the group of interface granules, unless it is there. False if all groups are taken.
  bool make_interface_group();

  void pack(int i, std::vector<double>& record, int& layout) override { records_.pack(i, record, layout); }
  std::vector<int> motion_words(int i, bool positions, bool spins) override { return records_.motion_words(i, positions, spins); }
  int groups_of(const std::vector<double>& record, int layout) override;
  void take_out(int i) override;
  int put_back(const std::vector<double>& record, int layout) override;
  void wrap(int i) override;
  void set_size(int i, double radius, double mass) override;
  void drop_ghosts() override;
  void send_far() override;
  int layouts() const override { return records_.layouts(); }
  std::string layout_text(int layout) const override { return records_.layout_text(layout); }
  int layout_from_text(const std::string& text) override { return records_.layout_from_text(text); }
  void publish_counts(std::int64_t returned, std::int64_t atoms, bool map_too_small) override;
  bool map_is_too_small() const override;
  void count_more(std::int64_t returned) override;
  void sort_soon() override;

 private:
  void clear_map();
  void find_ways();

  const LAMMPS_NS::Fix* own_;
  GranuleRecords records_;
  bool map_cleared_ = false;
  int groups_word_ = -1;  // of a record; unknown at first
  int releases_ = -1;     // number of the fix that holds when granules are released; -1: none
  bool puts_back_ = false;
};

}  // namespace solidcull
