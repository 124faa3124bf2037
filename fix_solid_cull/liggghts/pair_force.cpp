#include "pair_force.h"

#include <algorithm>

#include "atom.h"
#include "force.h"
#include "neigh_list.h"
#include "pair_gran.h"
#include "release.h"
#include "swapped.h"
#include "update.h"

namespace solidcull {
Vec3 PairForce::on_first(int i, int at) {
  const LAMMPS_NS::NeighList* list = force->pair->list;
  const LAMMPS_NS::NeighList* histories = force->pair->listgranhistory;
  if (!histories) return compute(i, list->firstneigh[i][at], 0, {});
  const int width = static_cast<LAMMPS_NS::PairGran*>(force->pair)->dnum();
  const double* from = histories->firstdouble[i] + static_cast<std::ptrdiff_t>(width) * at;
  return compute(i, list->firstneigh[i][at], histories->firstneigh[i][at], std::vector<double>(from, from + width));
}

Vec3 PairForce::on_first(int i, int j, const double* history) {
  const int width = static_cast<LAMMPS_NS::PairGran*>(force->pair)->dnum();
  return compute(i, j, history != nullptr,
                 history ? std::vector<double>(history, history + width) : std::vector<double>(width, 0.0));
}

void PairForce::release() { solidcull::release(force_rows_, torque_rows_, history_rows_, counts_, neighbour_rows_, flag_rows_); }

Vec3 PairForce::compute(int i, int neighbour, int flag, std::vector<double> history) {
  LAMMPS_NS::Pair* pair = force->pair;
  LAMMPS_NS::NeighList* list = pair->list;
  LAMMPS_NS::NeighList* histories = pair->listgranhistory;
  const std::size_t all = static_cast<std::size_t>(std::max(atom->nmax, atom->nlocal + atom->nghost));
  if (force_rows_.size() < all) {
    force_rows_.resize(all);
    torque_rows_.resize(all);
    counts_.resize(all);
    neighbour_rows_.resize(all);
    flag_rows_.resize(all);
    history_rows_.resize(all);
  }
  const int j = neighbour & NEIGHMASK;
  double force_i[3] = {0, 0, 0}, force_j[3] = {0, 0, 0}, torque_i[3] = {0, 0, 0}, torque_j[3] = {0, 0, 0};
  force_rows_[i] = force_i;
  force_rows_[j] = force_j;
  torque_rows_[i] = torque_i;
  torque_rows_[j] = torque_j;
  counts_[i] = 1;
  neighbour_rows_[i] = &neighbour;
  flag_rows_[i] = &flag;
  history_rows_[i] = history.data();

  Swapped f(atom->f, force_rows_.data());
  Swapped t(atom->torque, torque_rows_.data());
  Swapped count(list->inum, 1);
  Swapped rows(list->ilist, &i);
  Swapped counts(list->numneigh, counts_.data());
  Swapped neighbours(list->firstneigh, neighbour_rows_.data());
  Swapped setup(update->setupflag, 1);  // the engine's word for: do not advance histories
  int unused = 0;
  int& lists_are_newer = *static_cast<int*>(pair->extract("computeflag", unused));
  Swapped kept(lists_are_newer, lists_are_newer);
  if (!histories) {
    pair->compute(0, 0);
  } else {
    Swapped flags(histories->firstneigh, flag_rows_.data());
    Swapped values(histories->firstdouble, history_rows_.data());
    pair->compute(0, 0);
  }
  return Vec3(force_i[0], force_i[1], force_i[2]);
}

}  // namespace solidcull
