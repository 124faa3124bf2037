// What becomes of culling beside each fix style of LIGGGHTS. The same table stands in other_styles.md; a test compares them,
// and that every style of `liggghts -h` is in it.
#pragma once

#include <string>

namespace solidcull {

enum class Treatment {
  exact,       ///< works on all granules, stored ones too, or on none
  integrates,  ///< moves granules: what none of these moves is not culled
  atoms_only,  ///< measures, and sees atoms only
  holds,       ///< keeps granules where it wants them: its group stays exterior
  drives,      ///< adds forces, or sums up over steps, for each granule: its group stays exterior, and a line says so
  refused
};

struct FixStyle {
  const char* name;  ///< a star at the end: all that begin with what is before it
  Treatment treatment;
  const char* why;  ///< for the line, if there is one
};

/// For a style that is not LIGGGHTS's own: drives.
const FixStyle& treatment_of(const std::string& style);

}  // namespace solidcull
