// What each owned granule knows of walls, found at the looks.
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "bed.h"
#include "per_granule.h"
#include "store_exchange.h"

namespace solidcull {

struct AtWall {
  int touched = 0;          ///< walls and triangles touched
  bool moves = false;       ///< one of them can move
  bool stands = false;      ///< one of them stands still
  bool near = true;         ///< within the skin of a wall; true until a look has seen that it is not
  bool moving_near = true;  ///< of one that can move; likewise
  double slip = 0;          ///< largest velocity of the granule's surface at one of them (m/s)

  static constexpr int packed_size = 5;
  void pack(double* to) const {
    const double values[packed_size] = {double(touched), double(moves), double(stands), double(near), double(moving_near)};
    std::copy_n(values, packed_size, to);
  }
  static AtWall unpack(const double* v) {
    AtWall w;
    w.touched = static_cast<int>(v[0]);
    w.moves = v[1] != 0;
    w.stands = v[2] != 0;
    w.near = v[3] != 0;
    w.moving_near = v[4] != 0;
    return w;
  }
};

/// Local.
class WallSurvey : public StoreFollower {
 public:
  explicit WallSurvey(const Bed& bed) : bed_(bed) {}

  const AtWall& operator[](int i) const { return rows_[i]; }
  PerGranule<AtWall>& rows() { return rows_; }
  void goes(int i, int& walls, std::vector<WallLoad>&) override { walls = rows_[i].touched; }
  void came_back(int i, const StoredGranule& g, const Vec3&) override {
    rows_.reset(i);
    rows_[i].touched = g.walls;
  }

  /// At a look. Interface granules wake whose wall has gone: at the start of a run any, within a run one that can move.
  void update(const std::vector<WallContact>& contacts, bool new_run);
  /// At the start of a run: whether a wall of the run before is not there any more.
  bool take_gone();
  /// A run has ended.
  void remember_walls() { fingerprint_ = fingerprint(); }
  /// Whether walls that stand still may be others than at the end of the last run, on any rank. Collective.
  bool walls_are_others() const { return bed_.ranks.any(fingerprint_ != fingerprint()); }

 private:
  // a granule still stands at a wall that is this share of its radius away, or nearer
  static constexpr double still_there = 0.01;

  /// The skin too: it says what is near.
  std::vector<double> fingerprint() const {
    std::vector<double> f = bed_.walls.fingerprint();
    f.push_back(bed_.run.skin);
    return f;
  }

  const Bed& bed_;
  PerGranule<AtWall> rows_;
  std::vector<double> fingerprint_;
  std::vector<std::string> names_then_;
};

}  // namespace solidcull
