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
  /// What the engine's exchange of atoms would not bring to its owner, but lose, goes there: out of a store that lags behind, of
  /// clumps longer than a subdomain is wide, or where it was packed anew. Last of all.
  void send_far();

  /// Interface granules may have come from other ranks, or left the box.
  void take_arrivals();
  /// The engine may have lost interface granules. Local: bodies over several ranks are settled with the next change.
  void forget_lost();
  /// Whether some wait for that. Local.
  bool is_unsettled() const { return unsettled_; }
  /// After granules came from a file or another rank.
  void count_restored();

 private:
  /// What all ranks know as a change begins.
  struct Occasion {
    bool asked = false;  ///< something is to wake, or was chosen
    Woke wakes_all = Woke::never;
    bool lets_go = false;  ///< bodies that stood on walls do no longer
    bool asks_to_store = false;
    bool made = false;         ///< there are new granules
    std::int64_t highest = 0;  ///< tag of an atom
    bool changes() const { return asked || wakes_all != Woke::never || lets_go; }
  };
  /// And when it has been made.
  struct Outcome {
    bool shell_changed = false, some_leave = false, sorts = false, map_too_small = false, some_far = false;
    std::int64_t bodies = 0, locked = 0, stored = 0, atoms = 0;
  };
  Occasion begin(const Look& look);
  Outcome see(bool shell_changed, const MembershipChange& c);
  bool any_far_out() const;
  bool any_lost_on_the_way() const;
  void settle_bodies();
  void follow_box();
  void move_cuts();
  void take_subdomains();
  void wake_counted_clumps();
  bool meet_new_granules(Phase phase);
  bool stores_asleep() const;
  void close_shell(bool changes, bool& shell_changed);
  void pack(bool& shell_changed);
  void store_and_fetch(const MembershipChange& c, const Occasion& now, bool changes, bool& shell_changed);
  void fit_memory(Phase phase);

  Bed& bed_;
  CullingParts& p_;
  bool some_far_ = false;   // send_far() is due, on all ranks
  bool unsettled_ = false;  // bodies over several ranks, since interface granules were lost
};

}  // namespace solidcull
