// LIGGGHTS's run: time, box, gravity, what is said to the user.
#pragma once

#include <cstdint>
#include <string>

#include "fix.h"
#include "pointers.h"
#include "ports.h"

namespace solidcull {

class EngineRun : public Run, protected LAMMPS_NS::Pointers {
 public:
  EngineRun(LAMMPS_NS::LAMMPS* lmp, LAMMPS_NS::Fix* own) : Pointers(lmp), own_(own) { name = own->id; }

  /// Step, time step, skin and box may be others. At each hook. Local.
  void renew();

  Vec3 gravity() const override;
  Vec3 wrapped(const Vec3& place) const override;
  bool ask_for_reneighbouring(std::int64_t at) override;
  double seconds_of_pair_forces() const override;
  void say(const std::string& line) const override;

 private:
  LAMMPS_NS::Fix* own_;
};

}  // namespace solidcull
