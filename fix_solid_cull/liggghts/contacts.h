// LIGGGHTS's neighbour lists, contact histories and contact law.
#pragma once

#include <vector>

#include "contact_histories.h"
#include "pair_force.h"
#include "pointers.h"
#include "ports.h"

namespace solidcull {

class EngineContacts : public Contacts, protected LAMMPS_NS::Pointers {
 public:
  explicit EngineContacts(LAMMPS_NS::LAMMPS* lmp) : Pointers(lmp), histories_(lmp), pair_force_(lmp) {}

  /// A run begins: the pair style may be another. Local.
  void connect();
  void renew();  ///< at each hook. Local
  void release_memory() { pair_force_.release(); }

  NeighbourRows neighbours() const override;
  HistoryRows histories() const override { return histories_.rows(); }
  std::vector<bool> flips() const override { return histories_.flips(); }
  std::vector<int> vectors() const override { return histories_.vectors(); }
  void bring_histories_up_to_date() override { histories_.bring_up_to_date(); }
  void forget_neighbours() override;
  void give_histories(int i, const History* contacts, std::size_t n) override { histories_.give(i, contacts, n); }
  void clear_histories(int i) override { histories_.clear(i); }
  Vec3 force_on_first(int i, int k) override { return pair_force_.on_first(i, k); }
  Vec3 force_on_first(int i, int j, const double* history) override { return pair_force_.on_first(i, j, history); }
  void leave_out_pairs_within(const std::vector<std::int64_t>& body_of_atom) override;

 private:
  ContactHistories histories_;
  PairForce pair_force_;
};

}  // namespace solidcull
