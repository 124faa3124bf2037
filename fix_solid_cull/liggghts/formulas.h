// What a formula of the deck rests on, when it is evaluated between two runs.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

namespace LAMMPS_NS {
class LAMMPS;
}

namespace solidcull {

enum class Reads {
  nothing,   ///< no granule: numbers, time, the box, what a mesh measured
  granules,  ///< them, or what was computed of them
  forces     ///< the forces on them, as of no particular step
};

/// Words of a formula that name something: functions, thermo keywords, c_ID, f_ID, v_NAME.
std::vector<std::string> words_of(const std::string& formula);

/// reads_fix: whether f_ID reads granules.
Reads reads_of(const std::string& formula, const std::function<bool(const std::string& id)>& reads_fix);
/// For this deck. Local.
Reads reads_of(const std::string& formula, LAMMPS_NS::LAMMPS* lmp);
/// Whether reading f_ID reads granules: it is a value of each, or the style is not known. Local.
bool fix_reads_granules(LAMMPS_NS::LAMMPS* lmp, const std::string& id);

/// Which words each fix, compute and variable of a deck was made with: what a fix averages is told by no function of the engine.
class Sources {
 public:
  /// name: f_ID or c_ID; words: of its line, of which some name others.
  void was_made(const std::string& name, const std::vector<std::string>& words);
  void variable_was_made(const std::string& name, const std::vector<std::string>& formula);
  const std::vector<std::string>& of(const std::string& word) const;
  void forget() { made_.clear(); }

 private:
  std::map<std::string, std::vector<std::string>> made_;  // by f_ID, c_ID, v_NAME
};
Sources& sources(LAMMPS_NS::LAMMPS* lmp);

/// Whether a culled granule may be in one of these engine groups (bits). Collective.
using CullsOf = std::function<bool(int groups)>;
/// The fix, as "fix ID (style)", whose value in the formula was measured in runs and of atoms only, where culled granules would
/// count; empty: there is none. Collective.
std::string fix_that_missed_granules(const std::string& formula, LAMMPS_NS::LAMMPS* lmp, const CullsOf& culls_of);

}  // namespace solidcull
