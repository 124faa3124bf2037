// The membership change: exterior <-> interface <-> interior, in one reneighbouring.
#pragma once

#include "culling_parts.h"
#include "look.h"
#include "membership_change.h"
#include "phase.h"

namespace solidcull {

/// The only place where atoms come and go. Collective, unless a function says otherwise.
class Change {
 public:
  explicit Change(CullingParts& parts) : bed_(parts.bed), p_(parts) {}

  /// Wakes all that asked, and culls what the look chose and still rests.
  void make(Look& look, Phase phase);

  /// Interface granules may have come from other ranks, or left the box.
  void take_arrivals();
  /// The engine may have lost interface granules.
  void forget_lost();
  /// After granules came from a file or another rank.
  void count_restored();

 private:
  void settle_bodies();
  void follow_box();
  void meet_new_granules(Phase phase);
  void close_shell(bool changes, bool& shell_changed);
  void pack(bool& shell_changed);
  void store_and_fetch(const MembershipChange& c, bool changes, bool& shell_changed);
  void publish(const MembershipChange& c);
  void fit_memory(Phase phase);

  Bed& bed_;
  CullingParts& p_;
};

}  // namespace solidcull
