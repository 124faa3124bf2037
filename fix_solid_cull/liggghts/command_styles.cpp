#include "command_styles.h"

#include <algorithm>
#include <initializer_list>

#include "compute_styles.h"
#include "fix_styles.h"
#include "style_table.h"

namespace solidcull {
namespace {

constexpr Sight nothing = Sight::nothing, run = Sight::run, state = Sight::state, whole_bed = Sight::whole_bed,
                all_restored = Sight::all_restored;

constexpr CommandStyle command_styles[] = {
    {"angle_*", nothing},
    {"atom_*", nothing},
    {"bond_*", nothing},
    {"boundary", nothing},
    {"box", nothing},
    {"clear", nothing},
    {"communicate", nothing},
    {"compute", nothing},  // but see below
    {"compute_modify", nothing},
    {"create_box", nothing},
    {"dielectric", nothing},
    {"dihedral_*", nothing},
    {"dimension", nothing},
    {"dump", nothing},
    {"dump_modify", nothing},
    {"echo", nothing},
    {"fix", nothing},  // but see below
    {"fix_modify", nothing},
    {"force_dt_reset", nothing},
    {"hard_particles", nothing},
    {"if", nothing},
    {"improper_*", nothing},
    {"include", nothing},
    {"info", nothing},
    {"jump", nothing},
    {"kspace_*", nothing},
    {"label", nothing},
    {"lattice", nothing},
    {"log", nothing},
    {"mass", nothing},
    {"min_*", nothing},
    {"modify_timing", nothing},
    {"neigh_modify", nothing},
    {"neighbor", nothing},
    {"newton", nothing},
    {"next", nothing},
    {"package", nothing},
    {"pair_coeff", nothing},
    {"pair_modify", nothing},
    {"pair_write", nothing},
    {"partition", nothing},
    {"print", nothing},
    {"processors", nothing},
    {"quit", nothing},
    {"region", nothing},
    {"reset_timestep", nothing},
    {"restart", nothing},
    {"run_style", nothing},
    {"shell", nothing},
    {"soft_particles", nothing},
    {"special_bonds", nothing},
    {"suffix", nothing},
    {"thermo*", nothing},
    {"timestep", nothing},
    {"uncompute", nothing},
    {"undump", nothing},
    {"unfix", nothing},
    {"units", nothing},
    {"variable", nothing},
    {"write_restart_on_signal", nothing},

    {"minimize", run},
    {"run", run},
    {"run_time", run},

    {"write_restart", state},  // but see below

    {"create_atoms", whole_bed},
    {"delete_atoms", whole_bed},  // but see below
    {"delete_bonds", whole_bed},
    {"displace_atoms", whole_bed},
    {"group", whole_bed},
    {"rotate", whole_bed},
    {"set", whole_bed},
    {"velocity", whole_bed},
    {"write_data", whole_bed},
    {"write_dump", whole_bed},

    {"change_box", all_restored},
    {"pair_style", all_restored},
    {"read_data", all_restored},
    {"read_dump", all_restored},
    {"read_restart", all_restored},
    {"replicate", all_restored},
};

constexpr CommandStyle not_known = {"", all_restored};

bool is_one_of(const std::string& word, std::initializer_list<const char*> list) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

/// delete_atoms gives new tags to all that are left, unless told not to.
bool renumbers(const std::vector<std::string>& words) {
  bool yes = true;
  for (std::size_t w = 0; w + 1 < words.size(); ++w)
    if (words[w] == "compress") yes = words[w + 1] != "no";
  return yes;
}

/// Some remember each granule as it is when they are made.
bool fix_reads_granules(const std::string& style) {
  const Treatment t = treatment_of(style).treatment;
  return t == Treatment::drives || t == Treatment::holds || style == "store/state";
}
bool compute_reads_granules(const std::string& style) {
  const ComputeStyle& known = measure_of(style);
  return known.measure == Measure::whole || style == "displace/atom" || *known.name == 0;
}

}  // namespace

Sight sight_of(const std::string& command, const std::vector<std::string>& words, bool engine_has_it) {
  if (command == "delete_atoms" && renumbers(words)) return all_restored;
  if (command == "write_restart" && words.size() > 1 && words[1] == "region") return all_restored;  // some granules only
  if (command == "fix" && words.size() > 2 && fix_reads_granules(words[2])) return whole_bed;
  if (command == "compute" && words.size() > 2 && compute_reads_granules(words[2])) return whole_bed;
  const CommandStyle& found = row_of(command, command_styles, not_known);
  return *found.name == 0 && !engine_has_it ? nothing : found.sight;
}

std::string only_group_of(const std::string& command, const std::vector<std::string>& words) {
  const auto evaluates = [](const std::string& w) { return is_one_of(w.substr(0, 2), {"v_", "c_", "f_"}); };
  if (words.size() < 2 || std::any_of(words.begin(), words.end(), evaluates)) return "";
  if (command == "set" && words[0] == "group") return words[1];
  if (command == "velocity" && words[1] == "set") return words[0];  // other words count all granules, or their temperature
  return "";
}

}  // namespace solidcull
