// The small world's clumps: rigid granules of several spheres, on one rank or several.
#pragma once

#include <map>
#include <vector>

#include "ports.h"

namespace solidcull {

class SmallWorld;

/// Each is a row of the rank that owns its centre. A sphere knows its clump's number and its arm, its place in the clump's axes.
/// Places need no images here: a sphere stands beside its centre wherever that is nearest to where it stood.
class SmallClumps : public Clumps {
 public:
  explicit SmallClumps(SmallWorld& world);
  int count() const override { return static_cast<int>(rows_.size()); }
  Clump clump(int k) const override { return rows_.at(static_cast<std::size_t>(k)); }
  Vec3 centre(int k) const override { return clump(k).lies.centre; }
  int find(int number) const override;
  double largest() const override;
  void know_largest(double apart) override;
  int highest_number() const override { return highest_; }
  void publish_count(std::int64_t all) override { published = all; }
  void keep_number(int number) override { highest_ = std::max(highest_, number); }
  Clump take(int number) override;
  void put(const Clump& clump, int sphere) override;
  void set_clump(int i, int number) override;
  void join_image(int, int) override {}
  void send_far(const Ranks&) override {}  // rows go to any rank here

  // --- the small engine's side. Collective, but for what says otherwise.
  /// Its spheres have the tags from `first_tag` on. Returns its number, the next one.
  int make(int first_tag, const std::vector<Sphere>& spheres, const Vec3& velocity = Vec3::Zero(),
           const Vec3& spin = Vec3::Zero());
  void take_loads();  ///< of all spheres
  void kick();        ///< by half a step. Local
  void drift();       ///< by a step; the spheres follow
  void give_velocities();
  /// Rows go to the rank that owns their centre. A clump that has lost a sphere is deleted with the others.
  void exchange();
  /// A row as a file keeps it. Local
  void read(const Clump& clump);
  void throw_all(const Vec3& velocity);  ///< none turns. Local

  std::int64_t published = -1;

 private:
  enum Rest { colour, apart, rest_numbers };  // the culling knows nothing of either
  struct Load {
    Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
  };
  struct Motion;
  std::map<int, Motion> motions() const;
  void move_spheres(bool places_too);
  void delete_broken();

  SmallWorld& world_;
  std::vector<Clump> rows_;
  std::map<int, Load> loads_;  // by number
  int highest_ = 0;
  mutable double largest_ = 0;
};

}  // namespace solidcull
