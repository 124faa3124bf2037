#include "pair_force.h"

#include <algorithm>

#include "atom.h"
#include "force.h"
#include "neigh_list.h"
#include "pair_gran.h"
#include "update.h"

namespace solidcull {
namespace {

/// Sets a variable for a scope.
template <class T>
class Swapped {
 public:
  Swapped(T& variable, T value) : variable_(variable), old_(variable) { variable = value; }
  ~Swapped() { variable_ = old_; }

 private:
  T& variable_;
  T old_;
};

}  // namespace

Vec3 PairForce::on_first(int i, int at) {
  LAMMPS_NS::Pair* pair = force->pair;
  LAMMPS_NS::NeighList* list = pair->list;
  LAMMPS_NS::NeighList* histories = pair->listgranhistory;
  const std::size_t all = static_cast<std::size_t>(atom->nlocal + atom->nghost);
  if (force_rows_.size() < all) {
    force_rows_.resize(all);
    torque_rows_.resize(all);
  }
  int neighbour = list->firstneigh[i][at];
  const int j = neighbour & NEIGHMASK;
  double force_i[3] = {0, 0, 0}, force_j[3] = {0, 0, 0}, torque_i[3] = {0, 0, 0}, torque_j[3] = {0, 0, 0};
  force_rows_[i] = force_i;
  force_rows_[j] = force_j;
  torque_rows_[i] = torque_i;
  torque_rows_[j] = torque_j;

  int flag = 0;
  std::vector<double> history;
  if (histories) {
    const int width = static_cast<LAMMPS_NS::PairGran*>(pair)->dnum();
    const double* from = histories->firstdouble[i] + static_cast<std::ptrdiff_t>(width) * at;
    flag = histories->firstneigh[i][at];
    history.assign(from, from + width);
  }
  int* flag_at = &flag;
  double* history_at = history.data();

  Swapped f(atom->f, force_rows_.data());
  Swapped t(atom->torque, torque_rows_.data());
  Swapped count(list->inum, 1);
  Swapped rows(list->ilist, &i);
  Swapped neighbours(list->numneigh[i], 1);
  Swapped first(list->firstneigh[i], &neighbour);
  Swapped setup(update->setupflag, 1);  // the engine's word for: do not advance histories
  if (!histories) {
    pair->compute(0, 0);
  } else {
    Swapped flags(histories->firstneigh[i], flag_at);
    Swapped values(histories->firstdouble[i], history_at);
    pair->compute(0, 0);
  }
  return Vec3(force_i[0], force_i[1], force_i[2]);
}

}  // namespace solidcull
