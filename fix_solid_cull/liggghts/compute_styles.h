// What each compute style of LIGGGHTS gives beside culling. The same table stands in other_styles.md; a test compares them, and
// that every style of `liggghts -h` is in it.
#pragma once

#include <string>

namespace solidcull {

enum class Measure {
  exact,       ///< hands on what others measured, or is of what is never stored
  atoms_only,  ///< right for each atom, or a sum over atoms
  contacts,    ///< right for exterior granules; contacts within solid bodies are missing
  whole,       ///< sets atoms against the whole group, or is of the group as a whole: its group stays exterior, with a line
  refused
};

struct ComputeStyle {
  const char* name;
  Measure measure;
  const char* why;  ///< for the line, if there is one; %s: the fix's ID
};

/// For a style that is not LIGGGHTS's own: atoms_only.
const ComputeStyle& measure_of(const std::string& style);

}  // namespace solidcull
