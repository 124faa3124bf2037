// One reneighbouring: exterior <-> interface <-> interior (theory.md#restoring says what a granule gets back).
// Lives on the stack of Change::make().
#pragma once

#include <cstdint>
#include <vector>

#include "bed.h"
#include "contact_freezing.h"
#include "proposal.h"
#include "shell_closure.h"
#include "store_exchange.h"
#include "survey.h"
#include "wake_requests.h"

namespace solidcull {

/// Who changes between exterior and interface, step by step; the steps that concern all of the culling stand in Change.
class MembershipChange {
 public:
  struct Parts {
    Survey& survey;
    StoreExchange& exchange;
    ShellClosure& closure;
    ContactFreezing& freezing;
  };

  MembershipChange(Bed& bed, const Parts& parts, Wakes wakes, Proposal proposal);

  /// Whether anything changes by wakes and proposal, on this rank. Local.
  bool any_here() const { return !wakes_.none() || proposal_.any_here(); }

  /// Granules that wake are unlocked, and come back from the store first; those that were chosen, and still may, are locked;
  /// ranks tell each other. Collective.
  void free_and_lock();
  /// What is free leaves its body, what is locked goes into one, and bodies that come apart, grow or merge are settled; contacts
  /// thaw and freeze with that. Collective.
  void change_bodies();

  const FlatMap<char>& freed_anywhere() const { return changes_.freed_anywhere; }
  bool locked_some() const { return !changes_.locked.empty(); }
  std::size_t moved() const { return changes_.freed.size() + changes_.locked.size(); }

 private:
  void free_what_wakes();
  void lock_what_was_chosen();
  void tell_neighbours();
  void lock(int i);
  void unlock(int i, Woke by);
  void name_rest_of_clumps(const std::vector<std::int64_t>& stored, FlatMap<Woke>& by) const;
  void lock_clumps(const std::vector<int>& locked);
  void give_clump_back(int sphere, int body, bool as_it_was, MovingGranule& given);
  bool still_rests(int i) const;
  void thaw_and_unlock();
  bool goes_back(int i) const;
  void leave_body(std::int64_t tag);
  void freeze_and_lock();
  void lock_into_body(std::int64_t tag);
  void lock_into_bodies();

  Bed& bed_;
  const Parts p_;
  const Wakes wakes_;
  const Proposal proposal_;
  Changes changes_;
};

}  // namespace solidcull
