// After most granules went into the store: the engine's arrays, which only ever grow, are cut to what is left.
#pragma once

#include <cstddef>

#include "atoms.h"
#include "contacts.h"
#include "engine_access.h"
#include "pointers.h"
#include "ports.h"

namespace solidcull {

/// Local to the rank. Only in pre_exchange, after the contact histories are in the partner lists: the neighbour lists that are
/// there are given up.
class EngineMemory : public Memory, protected LAMMPS_NS::Pointers {
 public:
  EngineMemory(LAMMPS_NS::LAMMPS* lmp, EngineAtoms& atoms, EngineContacts& contacts)
      : Pointers(lmp), atoms_(atoms), contacts_(contacts) {}

  /// A program keeps pointers into the arrays: they are not cut from now on.
  void keep_arrays() { arrays_stay_ = true; }
  /// Neighbour lists and the histories in them, a third of what a bed takes.
  void make_room(std::size_t granules) override;
  void give_rows_back(int left) override;
  bool too_large() const override;
  void fit() override;
  /// What lies between living blocks goes back to the system once it is much.
  void freed(std::size_t bytes) override;

  /// The engine fills all bins of the box at each build, some ten for each granule of a bed, atoms or not. While few atoms are
  /// left and some granules are stored, bins are wider, but for those whose width the deck gives. The engine lists pairs by bins,
  /// so sums of forces may differ in their last bit. Same times as fit(); not at the start of a run.
  void fit_bins(bool some_stored) override;
  /// They are again as the engine makes them.
  void give_bins_back() override;
  void expect_stored(double largest_radius) override;

 private:
  void widen_bins(double edge);
  /// The most atoms for which arrays are no larger than they should be where so many are left.
  int fair(int left) const;

  EngineAtoms& atoms_;
  EngineContacts& contacts_;
  std::size_t freed_ = 0;  // since the last trim
  bool wide_ = false, arrays_stay_ = false;
  engine::BinEdges ours_{};  // while they are wide (m)
};

}  // namespace solidcull
