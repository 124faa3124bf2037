// Which exterior granules are in solid state (theory.md#solid-state), and which of them are to be culled
// (theory.md#which-granules-are-culled).
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "awake.h"
#include "bed.h"
#include "body_motion.h"
#include "cover.h"
#include "flat_map.h"
#include "pacing.h"
#include "per_granule.h"
#include "proposal.h"
#include "wall_survey.h"

namespace solidcull {

/// What the looks remember of a granule.
struct AtRest {
  int calm = 0;                  ///< looks in a row in solid state; of an interface granule: at rest against another body
  int waited = 0;                ///< looks since it could have been culled
  std::int64_t since = -1;       ///< step in which calm began
  Vec3 velocity = Vec3::Zero();  ///< then (m/s)
  Vec3 acceleration_around = Vec3::Zero();  ///< of what it touched then (m/s^2)
  double normal_load = Locked::not_known;   ///< sum of normal contact forces at the last look (N)
  Awake awake = Awake::count;               ///< what kept it awake at the last look
  Woke woke_by = Woke::never;               ///< it was culled, and is free again:
  Vec3 woke_at = Vec3::Zero();              ///< where it was then (m)

  bool woken() const { return woke_by != Woke::never; }
  /// Both reasons in one number; 1 for a granule of a file that is older than them, which woke.
  double reasons() const { return double(woke_by) + 16.0 * ((double(awake) + 1) * (awake != Awake::count)); }
  static constexpr int packed_size = 14;
  void pack(double* to) const {
    const double values[packed_size] = {double(calm),
                                        double(waited),
                                        double(since),
                                        velocity[0],
                                        velocity[1],
                                        velocity[2],
                                        acceleration_around[0],
                                        acceleration_around[1],
                                        acceleration_around[2],
                                        normal_load,
                                        reasons(),
                                        woke_at[0],
                                        woke_at[1],
                                        woke_at[2]};
    std::copy_n(values, packed_size, to);
  }
  static AtRest unpack(const double* v) {
    AtRest r;
    r.calm = static_cast<int>(v[0]);
    r.waited = static_cast<int>(v[1]);
    r.since = static_cast<std::int64_t>(v[2]);
    r.velocity = vec(v + 3);
    r.acceleration_around = vec(v + 6);
    r.normal_load = v[9];
    const int why = static_cast<int>(v[10]);
    r.woke_by = static_cast<Woke>(why % 16);
    r.awake = why < 16 ? Awake::count : static_cast<Awake>(why / 16 - 1);
    r.woke_at = vec(v + 11);
    return r;
  }
};

/// Sees at each look who is in solid state, for how many looks, and proposes what is to be culled. Writes AtRest.
class Survey {
 public:
  Survey(const Bed& bed, const BodyMotion& motion, const WallSurvey& walls) : bed_(bed), motion_(motion), walls_(walls) {}

  const AtRest& operator[](int i) const { return rows_[i]; }
  PerGranule<AtRest>& rows() { return rows_; }
  struct Reasons {
    int awake, woke;  ///< numbers of fix_solid_cull.md; 0 of an interface granule
  };
  Reasons reasons(int i) const {
    if (bed_.shell.locked(i)) return {0, 0};
    return {1 + static_cast<int>(rows_[i].awake), static_cast<int>(rows_[i].woke_by)};
  }
  bool stands_at_wall(int i) const { return walls_[i].stands; }
  /// Owned granule i is free again.
  void note_wake(int i, Woke by) {
    begin_anew(i);
    rows_[i].woke_by = by;
    rows_[i].woke_at = bed_.atoms.place(i);
  }
  /// What audits wake is not culled while one lasts. Local.
  void watch(bool lasts);
  bool is_watched(int i) const { return watches_ && rows_[i].woke_by == Woke::audit; }
  /// It is locked; if it had been before: whether it has moved by more than d/100 since, where nothing carries it along.
  enum class Rested { first_time, unmoved, moved };
  Rested note_lock(int i) {
    begin_anew(i);
    if (!rows_[i].woken()) return Rested::first_time;
    rows_[i].woke_by = Woke::never;
    return way_since_woken(i) > moved_share * bed_.scales.diameter() ? Rested::moved : Rested::unmoved;
  }

  // --- a look, in this order
  /// Counts looks in solid state, and finds bodies that rest against each other. Returns how many exterior granules of this rank
  /// have been in solid state for long enough. Collective.
  std::int64_t find_calm(const Patience& patience, Proposal& proposal);
  /// Instead of it, where culling waits: nobody is calm. Local.
  void forget_calm();
  /// Granules whose load still changes from look to look are no solid state, however slowly they move; nor are they chosen. One
  /// look before they could go, so that none is lost. Local, but for clumps: then collective.
  void leave_out_unsteady(const Patience& patience, Proposal& proposal);
  /// `exterior sleep`: whoever is in solid state is chosen, but for a cover around what is not. Collective.
  void choose_asleep(const Patience& patience, Proposal& proposal);
  /// `exterior live`: whoever is in solid state and deep below the surface. Likewise.
  void choose_deep(const Patience& patience, Cover& cover, Proposal& proposal);
  /// Whether granules were chosen here, or within reach of this rank's. Collective.
  bool some_chosen_near(const Proposal& proposal) const;
  /// What ties the chosen to their neighbours; who would make no solid is left out. Local, but for clumps: then collective.
  void tie(Proposal& proposal);

  /// What keeps this rank's exterior granules awake, at the end of a look. Local.
  AwakeSteps see_awake(const Patience& patience, const Proposal& proposal);

  /// Kinetic energy of what is exterior (J). Collective.
  double kinetic_energy_of_exterior() const;
  std::int64_t exterior_here() const;

 private:
  static constexpr double moved_share = 0.01;    // of d
  static constexpr double stands_share = 0.003;  // likewise

  struct Pair {
    int i, j;
  };
  struct Seen;
  void begin_anew(int i) {
    rows_[i].calm = rows_[i].waited = 0;
    rows_[i].normal_load = Locked::not_known;
    rows_[i].awake = Awake::count;
  }
  std::vector<Vec3> accelerations() const;
  void accelerate_clumps(std::vector<Vec3>& a) const;
  void see_clumps(Seen& seen) const;
  void unite_calm();
  Seen see_contacts(const SolidStateLaw& law) const;
  Vec3 frame_of(int i, const Seen& seen) const;
  Awake see(int i, const Seen& seen, const SolidStateLaw& law);
  double way_since_woken(int i) const;
  void begin_count();
  void join_bodies(const Seen& seen, int looks, Proposal& proposal);
  std::vector<char> find_steady(const std::vector<char>& asked);
  double weight_in_force(int i) const;
  int looks_for(int i, const Patience& patience) const;
  bool calm_enough(int i, const Patience& patience) const;
  void choose(int i, Proposal& proposal);

  const Bed& bed_;
  const BodyMotion& motion_;
  const WallSurvey& walls_;
  PerGranule<AtRest> rows_;
  std::vector<Awake> why_;  // of owned granules, as this look sees them
  AwakeSteps awake_;        // what find_calm() has counted
  bool watches_ = false;
};

}  // namespace solidcull
