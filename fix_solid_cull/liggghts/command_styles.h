// What the culling does before each command of a deck (invariant I9). The same table stands in other_styles.md; a test compares
// them, and that every command of LIGGGHTS is in it.
#pragma once

#include <string>
#include <vector>

namespace solidcull {

enum class Sight {
  nothing,      ///< reads and changes no granule
  run,          ///< begins a run
  state,        ///< takes what is culled as it is
  whole_bed,    ///< reads or changes granules or groups: all are atoms when it acts
  all_restored  ///< may make others of them: all are exterior when it acts, and stay so
};

struct CommandStyle {
  const char* name;  ///< a star at the end: all that begin with what is before it
  Sight sight;
};

/// For a command with its words: some read granules with certain words only. One that is not in the table restores all, where
/// the engine has it.
Sight sight_of(const std::string& command, const std::vector<std::string>& words, bool engine_has_it);

/// The only group on which a command that sees the whole bed can act, or an empty word.
std::string only_group_of(const std::string& command, const std::vector<std::string>& words);

}  // namespace solidcull
