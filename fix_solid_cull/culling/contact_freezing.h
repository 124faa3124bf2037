// A contact between two granules of one body waits, frozen; it comes back when one of them is free (theory.md#locking;
// invariants I3, I5).
#pragma once

#include <cstdint>
#include <vector>

#include "bed.h"
#include "flat_map.h"
#include "proposal.h"
#include "tag_pairs.h"

namespace solidcull {

/// Who changes in one reneighbouring: tags on this rank in the order of the changes, and on this rank or near it.
struct Changes {
  std::vector<std::int64_t> freed, locked;
  FlatMap<char> freed_anywhere, locked_anywhere;
  std::vector<Join> joins;
};

/// Local, but for freeze_between_merged().
class ContactFreezing {
 public:
  explicit ContactFreezing(Bed& bed) : bed_(bed) {}

  /// Contacts of what is to be freed go back to the engine. Whatever they are given to must be an atom by now.
  void thaw(const Changes& changes);
  /// Contacts of what has just been locked with its neighbours in a body, before bodies are made.
  void freeze(const Changes& changes, const Proposal& proposal);
  /// Two bodies that touched have become one: what the engine saw between them goes inside too. Collective.
  void freeze_between_merged();
  /// At the first forces after thaw(): a contact that came out of the body brings the load that it had inside, no change for the
  /// granule that stays.
  void rebase_thawed();

  /// The engine has searched for neighbours: pairs within bodies stand in its lists.
  void note_new_lists() { inner_pairs_listed_ = true; }
  bool inner_pairs_listed() const { return inner_pairs_listed_; }
  /// They leave the lists.
  void leave_out_inner_pairs();

 private:
  bool is_locked(std::int64_t tag, const Changes& changes) const;
  bool just_locked(int i) const;
  void rebase(int i, std::int64_t partner, const double* history);

  Bed& bed_;
  bool inner_pairs_listed_ = false;
  FlatMap<char> thawed_;  // granules that were freed in the last change, here or near
};

}  // namespace solidcull
