// Contacts between two stored granules. They wait in the tails of the store's rows, where they take less than in a graph.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "granule_store.h"
#include "solid_bodies.h"

namespace solidcull {

/// Contacts of one granule, histories as it sees them.
class ContactList {
 public:
  explicit ContactList(std::size_t width) : width_(width) {}
  void clear() {
    partners_.clear();
    stored_.clear();
    known_.clear();
    numbers_.clear();
  }
  /// history: `width` numbers, which are copied, or nullptr. stored: the partner, where it is known to be stored.
  void add(std::int64_t partner, const double* history, const Resident* stored = nullptr) {
    partners_.push_back(partner);
    stored_.push_back(stored ? *stored : Resident{Vec3::Zero(), 0, nobody, 0});
    known_.push_back(history != nullptr);
    numbers_.resize(numbers_.size() + width_);
    if (history) std::copy(history, history + width_, numbers_.end() - static_cast<std::ptrdiff_t>(width_));
  }
  std::size_t size() const { return partners_.size(); }
  std::int64_t partner(std::size_t k) const { return partners_[k]; }
  /// The partner in the store, nothing if it is not there.
  std::optional<Resident> stored(std::size_t k, const GranuleStore& store) const {
    if (stored_[k].tag != nobody) return stored_[k];
    return store.find(partners_[k]);
  }
  const double* history(std::size_t k) const { return known_[k] ? numbers_.data() + k * width_ : nullptr; }

 private:
  static constexpr std::int64_t nobody = INT64_MIN;

  std::size_t width_;
  std::vector<std::int64_t> partners_;
  std::vector<Resident> stored_;  // `nobody` where it is not known
  std::vector<char> known_;
  std::vector<double> numbers_;
};

/// What is known of a contact is in the tail of the one of the two granules that was stored later. Local to the rank; frames are
/// those of the bodies.
class InnerContacts {
 public:
  using Tail = std::vector<std::uint64_t>;

  InnerContacts(GranuleStore& store, const SolidBodies& bodies) : store_(store), bodies_(bodies) {}
  InnerContacts(const InnerContacts&) = delete;
  virtual ~InnerContacts() = default;
  /// As FrozenContacts::set_layout() and set_vectors() have them.
  virtual void set_layout(const std::vector<bool>& flips, const std::vector<int>& vectors) = 0;
  /// Adds the partners of a stored granule that are stored too; none for a granule that is not stored.
  virtual void find(std::int64_t tag, std::vector<std::int64_t>& partners) const = 0;
  /// Contacts of g, which is about to be stored: appends to `tail`, which is empty, what its row keeps of them. Returns for each
  /// whether it is kept here from now on; the others belong in the graph. all_given: no other stored granule is near it, as is
  /// known of one that comes from a file or another rank with its contacts.
  virtual std::vector<char> pack(const Resident& g, const ContactList& contacts, bool all_given, Tail& tail) = 0;
  /// Of a contact that find() finds, as g sees it; false if it has no history.
  virtual bool history(const Resident& g, std::int64_t partner, double* history) const = 0;
  /// g is about to leave the store: adds its contacts with stored granules to `contacts`, and forgets them.
  virtual void unpack(const Resident& g, ContactList& contacts) = 0;
  /// The histories inside this body turn; places are still those of before.
  virtual void turn(int body, const Eigen::Matrix3d& by) = 0;
  virtual bool keeps_histories() const { return true; }
  /// What it can keep may never stay in the graph.
  virtual bool packs_always() const { return false; }

 protected:
  std::size_t width() const { return flips_.size(); }
  void change_side(double* history) const {
    for (std::size_t d = 0; d < width(); ++d)
      if (flips_[d]) history[d] = -history[d];
  }
  void turn(double* history, const Eigen::Matrix3d& by) const {
    for (const int v : vectors_) {
      Eigen::Map<Vec3> vector(history + v);
      vector = by * Vec3(vector);
    }
  }
  /// From a to the image of b that it touches, in the frame of their body.
  Vec3 apart(const Resident& a, const Resident& b) const;

  GranuleStore& store_;
  const SolidBodies& bodies_;
  std::vector<bool> flips_;
  std::vector<int> vectors_;
};

}  // namespace solidcull
