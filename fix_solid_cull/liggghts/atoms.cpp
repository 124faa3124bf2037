#include "atoms.h"

#include <algorithm>
#include <cstring>

#include "atom.h"
#include "domain.h"
#include "engine_access.h"
#include "group.h"
#include "irregular.h"
#include "modify.h"
#include "output.h"
#include "update.h"

namespace solidcull {

EngineAtoms::EngineAtoms(LAMMPS_NS::LAMMPS* lmp, const LAMMPS_NS::Fix* own) : Pointers(lmp), own_(own), records_(lmp, own) {}

void EngineAtoms::renew() {
  owned = atom->nlocal;
  ghosts = atom->nghost;
  room = atom->nmax;
  const auto rows = [](double** a) { return a ? a[0] : nullptr; };
  x = rows(atom->x);
  v = rows(atom->v);
  omega = rows(atom->omega);
  f = rows(atom->f);
  torque = rows(atom->torque);
  radius = atom->radius;
  mass = atom->rmass;
  tag = atom->tag;
  type = atom->type;
  groups = atom->mask;
  own_bit = own_->groupbit;
  find_ways();
}

/// Granules of fix insert/stream come out of their face one by one.
void EngineAtoms::find_ways() {
  ways = {};
  if (releases_ < 0) return;
  if (releases_ >= modify->nfix || std::strcmp(modify->fix[releases_]->id, releases_id) != 0) connect();
  if (releases_ < 0 || !modify->fix[releases_]->array_atom) return;
  constexpr int step_of_release = 4;
  const LAMMPS_NS::Fix* fix = modify->fix[releases_];
  ways = {fix->array_atom[0] + step_of_release, fix->size_peratom_cols, static_cast<double>(update->ntimestep)};
}

void EngineAtoms::connect() { releases_ = modify->find_fix(releases_id); }

bool EngineAtoms::make_interface_group() {
  const std::string name = std::string(own_->id) + "_interface";
  int number = group->find(name.c_str());
  if (number < 0) {
    if (group->ngroup >= 32) return false;
    std::vector<std::string> words = {name, "subtract", "all", "all"};
    std::vector<char*> args;
    for (std::string& w : words) args.push_back(&w[0]);
    group->assign(static_cast<int>(args.size()), args.data());
    number = group->find(name.c_str());
  }
  interface_bit = group->bitmask[number];
  return true;
}

/// Before the first atom comes or goes: the map is cleared by the tags of the atoms that are there.
void EngineAtoms::clear_map() {
  if (!atom->map_style || map_cleared_) return;
  atom->map_clear();
  map_cleared_ = true;
}

void EngineAtoms::take_out(int i) {
  clear_map();
  records_.remove(i);
  renew();
}

/// Which word it is, one granule tells for all: it becomes an atom for a moment.
int EngineAtoms::groups_of(const std::vector<double>& record, int layout) {
  if (groups_word_ < 0) {
    const int i = put_back(record, layout);
    groups_word_ = records_.groups_word(i);
    take_out(i);
  }
  return GranuleRecords::whole_number(record[static_cast<std::size_t>(groups_word_)]);
}

int EngineAtoms::put_back(const std::vector<double>& record, int layout) {
  clear_map();
  puts_back_ = true;
  const int i = records_.append(record, layout);
  puts_back_ = false;
  renew();
  return i;
}

void EngineAtoms::wrap(int i) { domain->remap(atom->x[i], atom->image[i]); }

void EngineAtoms::set_size(int i, double radius, double mass) {
  atom->radius[i] = radius;
  atom->rmass[i] = mass;
}

void EngineAtoms::drop_ghosts() {
  clear_map();  // by the tags of ghosts too
  atom->nghost = 0;
  renew();
}

void EngineAtoms::send_far() {
  for (int i = 0; i < atom->nlocal; ++i) wrap(i);
  LAMMPS_NS::Irregular(lmp).migrate_atoms();
  renew();
}

/// A command may have made the map anew while granules with higher tags were stored.
bool EngineAtoms::map_is_too_small() const {
  const int highest = atom->nlocal ? *std::max_element(atom->tag, atom->tag + atom->nlocal) : 0;
  return atom->map_style && highest >= atom->get_map_size();
}

void EngineAtoms::publish_counts(std::int64_t returned, std::int64_t atoms, bool map_too_small) {
  atom->natoms = atoms;
  if (output->thermo) engine::expect_atoms(*output->thermo, static_cast<long>(returned));
  if (map_too_small) atom->map_init();
  if (!map_cleared_ && !map_too_small) return;
  atom->nghost = 0;
  atom->map_set();
  map_cleared_ = false;
  renew();
}

/// The map has room for the tags that it had room for, and they are all that there are as a rule.
void EngineAtoms::count_more(std::int64_t returned) {
  atom->natoms += returned;
  if (output->thermo) engine::expect_atoms(*output->thermo, static_cast<long>(returned));
  if (!atom->map_style || !map_cleared_ || map_is_too_small()) return;
  atom->map_set();
  map_cleared_ = false;
}

void EngineAtoms::sort_soon() {
  if (atom->sortfreq > 0) atom->nextsort = update->ntimestep;
}

}  // namespace solidcull
