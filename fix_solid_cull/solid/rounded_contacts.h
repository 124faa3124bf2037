// Contacts between two granules of a compact store. Their places tell what touches what, and the histories wait in few bits.
#pragma once

#include "inner_contacts.h"
#include "packed_history.h"

namespace solidcull {

class RoundedContacts : public InnerContacts {
 public:
  using InnerContacts::InnerContacts;
  void set_layout(const std::vector<bool>& flips, const std::vector<int>& vectors) override;
  void find(std::int64_t tag, std::vector<std::int64_t>& partners) const override;
  std::vector<char> pack(const Resident& g, const ContactList& contacts, bool all_given, Tail& tail) override;
  bool history(const Resident& g, std::int64_t partner, double* history) const override;
  void unpack(const Resident& g, ContactList& contacts) override;
  void turn(int body, const Eigen::Matrix3d& by) override;
  bool packs_always() const override { return true; }

 private:
  static constexpr std::size_t nowhere = SIZE_MAX;
  std::size_t place_in(WordView list, std::int64_t partner) const;
  void erase_from(const Resident& keeper, std::size_t at);
  void forget_alike(const Resident& keeper, std::int64_t tag);

  PackedHistory packed_;
};

}  // namespace solidcull
