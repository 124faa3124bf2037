// Contacts between two granules of a store that knows no places, but sites (theory.md#refill).
#pragma once

#include "inner_contacts.h"

namespace solidcull {

/// Two that are near each other at their sites hang together; no history is kept. What touched and has sites farther apart hangs
/// together still: that stays in the graph.
class SiteContacts : public InnerContacts {
 public:
  using InnerContacts::InnerContacts;
  void set_layout(const std::vector<bool>& flips, const std::vector<int>& vectors) override;
  void find(std::int64_t tag, std::vector<std::int64_t>& partners) const override;
  std::vector<char> pack(const Resident& g, const ContactList& contacts, bool all_given, Tail& tail) override;
  bool history(const Resident&, std::int64_t, double*) const override { return false; }
  void unpack(const Resident& g, ContactList& contacts) override;
  void turn(int, const Eigen::Matrix3d&) override {}
  bool keeps_histories() const override { return false; }
  bool packs_always() const override { return true; }
};

}  // namespace solidcull
