// The engine's granule-granule contact histories, as partner lists of the owned granules.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "pointers.h"
#include "ports.h"

namespace LAMMPS_NS {
class FixContactHistory;
}

namespace solidcull {

/// Valid between FixContactHistory::pre_exchange (which fills the partner lists) and the next neighbour build. Local.
class ContactHistories : protected LAMMPS_NS::Pointers {
 public:
  explicit ContactHistories(LAMMPS_NS::LAMMPS* lmp) : Pointers(lmp) {}

  /// Finds the engine's fix again (it is made and deleted with the pair style).
  void connect();
  /// One entry per history number: does it change sign with the side it is seen from? Empty without histories.
  std::vector<bool> flips() const;
  /// Which history numbers are vectors of space: the first of each three. By the engine's names for them: ...x, ...y, ...z or
  /// ..._0, ..._1, ..._2.
  std::vector<int> vectors() const;
  /// Outside of a time step: have the engine fill the partner lists from its neighbour lists if those are newer.
  void bring_up_to_date();

  HistoryRows rows() const;
  void clear(int granule);
  /// Adds n contacts to an owned granule's list; a partner that is there already keeps what it has.
  void give(int granule, const Contacts::History* contacts, std::size_t n);

 private:
  LAMMPS_NS::FixContactHistory* fix_ = nullptr;
  std::vector<double> buffer_;  // as the engine packs a granule's list
};

}  // namespace solidcull
