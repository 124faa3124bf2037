// The clumps of fix multisphere as the culling sees them.
#pragma once

#include <vector>

#include "pointers.h"
#include "ports.h"

namespace LAMMPS_NS {
class FixMultisphere;
class Multisphere;
}  // namespace LAMMPS_NS

namespace solidcull {

class EngineClumps : public Clumps, protected LAMMPS_NS::Pointers {
 public:
  explicit EngineClumps(LAMMPS_NS::LAMMPS* lmp) : Pointers(lmp) {}

  /// A run begins, or the fix is made: fixes may be others. Local.
  void connect();

  int count() const override;
  Clump clump(int k) const override;
  Vec3 centre(int k) const override;
  int find(int number) const override;
  double largest() const override;
  void know_largest(double apart) override { largest_ = std::max(largest_, apart); }
  int highest_number() const override;
  void publish_count(std::int64_t everywhere) override;
  Clump take(int number) override;
  void put(const Clump& clump, int sphere) override;
  void set_clump(int i, int number) override;
  void send_far(const Ranks& ranks) override;
  void join_image(int i, int to) override;
  void keep_number(int number) override;

 private:
  /// Where some columns stand in a row that is packed as numbers.
  struct Columns {
    int centre = 0, velocity = 0, angular_momentum = 0, spin = 0, quaternion = 0, axes[3] = {}, inertia = 0, mass = 0,
        spheres = 0, number = 0;
  };
  template <class Visit>
  void for_each_column(Visit visit) const;
  void find_columns();
  void remove(int k, int number);
  /// A packed row; returns which it is now.
  int add(double* row, int number);
  LAMMPS_NS::Multisphere& all() const;

  LAMMPS_NS::FixMultisphere* fix_ = nullptr;
  Columns at_;
  mutable double largest_ = 0;           // of all that were ever here
  mutable std::vector<double> numbers_;  // of one row
};

}  // namespace solidcull
