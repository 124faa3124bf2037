// A pointer to a private member may be named in an explicit template instantiation ([temp.explicit]): legal C++, and checked by
// the compiler against the engine's own headers, so a LIGGGHTS that names these members otherwise does not compile.
#include "engine_access.h"

#include "fix.h"
#include "fix_contact_history.h"
#include "fix_insert.h"
#include "fix_insert_pack.h"
#include "modify.h"
#include "thermo.h"

namespace solidcull::engine {

template <class Tag, typename Tag::type Member>
struct Expose {
  friend typename Tag::type member(Tag) { return Member; }
};

#define SOLIDCULL_EXPOSE(NAME, CLASS, TYPE, MEMBER) \
  struct NAME {                                     \
    using type = TYPE LAMMPS_NS::CLASS::*;          \
    friend type member(NAME);                       \
  };                                                \
  template struct Expose<NAME, &LAMMPS_NS::CLASS::MEMBER>;

using FixStyles = std::map<std::string, FixCreator>;
SOLIDCULL_EXPOSE(ModifyFixMap, Modify, FixStyles*, fix_map)
SOLIDCULL_EXPOSE(HistoryNewton, FixContactHistory, int*, newtonflag_)
SOLIDCULL_EXPOSE(HistoryNames, FixContactHistory, char**, history_id_)
SOLIDCULL_EXPOSE(InsertCompress, FixInsert, bool, compress_flag)
SOLIDCULL_EXPOSE(PackRegion, FixInsertPack, LAMMPS_NS::Region*, ins_region)
SOLIDCULL_EXPOSE(ThermoAtoms, Thermo, LAMMPS_NS::bigint, last_natoms)
#undef SOLIDCULL_EXPOSE

std::map<std::string, FixCreator>& fix_styles(LAMMPS_NS::Modify& modify) { return *(modify.*member(ModifyFixMap())); }

const int* history_newton_flags(const LAMMPS_NS::FixContactHistory& fix) { return fix.*member(HistoryNewton()); }

const char* history_name(const LAMMPS_NS::FixContactHistory& fix, int number) { return (fix.*member(HistoryNames()))[number]; }

bool compresses_tags(const LAMMPS_NS::FixInsert& fix) { return fix.*member(InsertCompress()); }

void expect_atoms(LAMMPS_NS::Thermo& thermo, long change) { thermo.*member(ThermoAtoms()) += change; }

const LAMMPS_NS::Region* insertion_region(const LAMMPS_NS::Fix* fix) {
  const auto* pack = dynamic_cast<const LAMMPS_NS::FixInsertPack*>(fix);
  return pack ? pack->*member(PackRegion()) : nullptr;
}

}  // namespace solidcull::engine
