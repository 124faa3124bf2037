// Contacts between two granules of an exact store: which there are, and their histories as ContactTail keeps them.
#pragma once

#include "contact_tail.h"
#include "inner_contacts.h"

namespace solidcull {

/// What does not touch, or is of another frame, or has a history that is no number, is left to the graph.
class ExactContacts : public InnerContacts {
 public:
  using InnerContacts::InnerContacts;
  void set_layout(const std::vector<bool>& flips, const std::vector<int>& vectors) override;
  void find(std::int64_t tag, std::vector<std::int64_t>& partners) const override;
  std::vector<char> pack(const Resident& g, const ContactList& contacts, bool all_given, Tail& tail) override;
  bool history(const Resident& g, std::int64_t partner, double* history) const override;
  void unpack(const Resident& g, ContactList& contacts) override;
  void turn(int body, const Eigen::Matrix3d& by) override;

 private:
  bool are_together(const Resident& a, const Resident& b) const;
  Vec3 normal(const Resident& a, const Resident& b) const;
  template <class Visit>
  void for_each_keeper(const Resident& g, Visit visit) const;

  HistoryBits bits_;
  mutable std::vector<Resident> near_;
  // for one granule at a time
  ContactTail own_{bits_}, other_{bits_};
  Tail words_;
};

}  // namespace solidcull
