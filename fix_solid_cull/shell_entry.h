// What the fix keeps per atom: the state of an interface granule, and what the looks remember of an exterior one.
#pragma once

#include <array>
#include <cstdint>

#include "implicit_surface.h"
#include "pose.h"
#include "sphere.h"

namespace solidcull {

struct ShellEntry {
  // interface granules
  bool locked = false;
  bool fresh = false;               ///< the reference load is taken in this step
  int body = 0;                     ///< the body in whose frame it stands, on this rank
  Vec3 place = Vec3::Zero();        ///< in the body's frame (m).
  Vec3 reference = Vec3::Zero();    ///< F_ext at locking, re-based when contacts change sides; frame of the body (N). Of an
                                    ///< exterior granule: acceleration of what it touched when calm began (m/s^2)
  Vec3 load_change = Vec3::Zero();  ///< F_ext - reference at the last step; frame of the body (N)
  static constexpr double not_known = -1;
  double normal_load = not_known;  ///< sum of normal contact forces at locking (N). Of an exterior granule: at the last look
  double excess = 0;               ///< largest load change over tolerance since the last wake-up
  std::int64_t lock_step = -1;     ///< of an exterior granule: when calm began
  bool held = false;               ///< touched a wall that stands still when it was locked
  Vec3 velocity = Vec3::Zero(), spin = Vec3::Zero();  ///< at locking, given back only if no step has passed. Of an exterior
                                                      ///< granule: its velocity when calm began

  // all granules
  int walls = 0;                 ///< walls and triangles touched at the last look
  bool wall_moves = false;       ///< one of them can move
  bool stands = false;           ///< one of them stands still
  double wall_slip = 0;          ///< largest velocity of its surface at one of them at the last look (m/s)
  bool wall_near = true;         ///< within the skin of a wall; true until a look has seen that it is not
  bool moving_wall_near = true;  ///< of one that can move; likewise
  std::int64_t came_back = -1;   ///< step in which it came out of the store

  // exterior granules
  int clear_in = -1;             ///< version of the store in which nothing stored was near
  Vec3 clear_at = Vec3::Zero();  ///< where it was then (m)
  int calm = 0;                  ///< looks in a row in solid state; of an interface granule: at rest against another body
  int waited = 0;                ///< looks since it could have been culled
  bool registered = false;       ///< known to the implicit surface
  Vec3 registered_at = Vec3::Zero();
  Voxel nearest_void = Voxel::nothing();

  /// What a restart file and another rank must get; the rest is found again by the next look. The body's frame stays behind:
  /// in_world() first, and the place is given anew.
  ShellEntry in_world(const Pose& pose) const {
    ShellEntry e = *this;
    e.reference = pose.turned_to_world(reference);
    e.load_change = pose.turned_to_world(load_change);
    return e;
  }
  static constexpr int packed_size = 29;
  void pack(double* to) const {
    const double values[packed_size] = {double(locked),   double(fresh),    reference[0],       reference[1],
                                        reference[2],     load_change[0],   load_change[1],     load_change[2],
                                        normal_load,      excess,           double(wall_moves), double(lock_step),
                                        velocity[0],      velocity[1],      velocity[2],        spin[0],
                                        spin[1],          spin[2],          double(walls),      double(wall_near),
                                        double(calm),     double(waited),   double(registered), registered_at[0],
                                        registered_at[1], registered_at[2], double(held),       double(moving_wall_near),
                                        double(stands)};
    for (int k = 0; k < packed_size; ++k) to[k] = values[k];
  }
  static ShellEntry unpack(const double* v) {
    ShellEntry e;
    e.locked = v[0] != 0;
    e.fresh = v[1] != 0;
    e.reference = Vec3(v[2], v[3], v[4]);
    e.load_change = Vec3(v[5], v[6], v[7]);
    e.normal_load = v[8];
    e.excess = v[9];
    e.wall_moves = v[10] != 0;
    e.lock_step = static_cast<std::int64_t>(v[11]);
    e.velocity = Vec3(v[12], v[13], v[14]);
    e.spin = Vec3(v[15], v[16], v[17]);
    e.walls = static_cast<int>(v[18]);
    e.wall_near = v[19] != 0;
    e.calm = static_cast<int>(v[20]);
    e.waited = static_cast<int>(v[21]);
    e.registered = v[22] != 0;
    e.registered_at = Vec3(v[23], v[24], v[25]);
    e.held = v[26] != 0;
    e.moving_wall_near = v[27] != 0;
    e.stands = v[28] != 0;
    return e;
  }
};

}  // namespace solidcull
