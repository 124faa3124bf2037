// What keeps exterior granules awake, in granule-steps, and what woke them.
#pragma once

#include <array>
#include <cstddef>

namespace solidcull {

/// Why a look does not cull a granule. The first that holds, in this order.
enum class Awake : unsigned char {
  held,      ///< the deck holds or drives it, or it is not of the fix's group
  alone,     ///< it touches nothing that presses on it
  moving,    ///< faster than `speed`
  unsteady,  ///< out of balance
  settling,  ///< calm, but not for long enough
  covered,   ///< in solid state, but within `depth` of what is not, or of the surface
  paused,    ///< culling waits: it has not paid, or gravity turns, or all was shaken awake
  count      ///< of a single granule: no look has seen it since it woke, or since the run began
};

/// Why a granule that was culled came back. The one that asked and what is carved out with it have the same.
enum class Woke : unsigned char {
  never,
  load,       ///< a load changed by more than `tolerance`
  shaken,     ///< its body feels another gravity, or is accelerated otherwise
  exposed,    ///< its cover got thinner than `depth`
  wall,       ///< a wall that it stood at has gone
  insertion,  ///< a new granule lies in its place
  deck,       ///< a command, a program or another fix took it
  no_gain,    ///< culling did not pay
  lost,       ///< a sphere of its clump left the simulation
  audit,      ///< it was drawn for an audit
  count
};

/// Numbers by a reason.
template <class Reason>
struct ByReason {
  std::array<double, static_cast<int>(Reason::count)> of{};

  double& operator[](Reason why) { return of[static_cast<int>(why)]; }
  double operator[](Reason why) const { return of[static_cast<int>(why)]; }
  double all() const {
    double sum = 0;
    for (const double n : of) sum += n;
    return sum;
  }
  void add(const ByReason& other, double times) {
    for (std::size_t k = 0; k < of.size(); ++k) of[k] += times * other.of[k];
  }
};
using WokenBy = ByReason<Woke>;  ///< granules

struct AwakeSteps : ByReason<Awake> {  // by what keeps them awake
  double nearly_slow = 0;              ///< of the moving: would be calm with twice the `speed`
  double nearly_balanced = 0;          ///< of the unsteady: with twice the `tolerance`
  double in_vain = 0;                  ///< woken, and still where they were: of any of these

  /// As many as `now` says, for so many steps.
  void add(const AwakeSteps& now, double steps) {
    ByReason::add(now, steps);
    nearly_slow += steps * now.nearly_slow;
    nearly_balanced += steps * now.nearly_balanced;
    in_vain += steps * now.in_vain;
  }
};

}  // namespace solidcull
