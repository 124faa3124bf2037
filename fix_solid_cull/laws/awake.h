// What keeps exterior granules awake, in granule-steps.
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
  count
};

struct AwakeSteps {
  std::array<double, static_cast<int>(Awake::count)> of{};  ///< by what keeps them awake
  double nearly_slow = 0;                                   ///< of the moving: would be calm with twice the `speed`
  double nearly_balanced = 0;                               ///< of the unsteady: with twice the `tolerance`
  double in_vain = 0;                                       ///< woken, and still where they were: of any of these

  double& operator[](Awake why) { return of[static_cast<int>(why)]; }
  double operator[](Awake why) const { return of[static_cast<int>(why)]; }
  double all() const {
    double sum = 0;
    for (const double n : of) sum += n;
    return sum;
  }
  /// As many as `now` says, for so many steps.
  void add(const AwakeSteps& now, double steps) {
    for (std::size_t k = 0; k < of.size(); ++k) of[k] += steps * now.of[k];
    nearly_slow += steps * now.nearly_slow;
    nearly_balanced += steps * now.nearly_balanced;
    in_vain += steps * now.in_vain;
  }
};

}  // namespace solidcull
