// LIGGGHTS's fixes that insert granules, or count those that pass a mesh.
#pragma once

#include <vector>

#include "pointers.h"
#include "ports.h"

namespace solidcull {

class EngineInsertions : public Insertions, protected LAMMPS_NS::Pointers {
 public:
  explicit EngineInsertions(LAMMPS_NS::LAMMPS* lmp) : Pointers(lmp) {}

  bool any_due(std::int64_t step) const override;
  std::vector<Box> due_boxes(double largest) const override;
  std::vector<Box> counting(double margin) const override;
};

}  // namespace solidcull
