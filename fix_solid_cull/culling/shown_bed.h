// The whole bed as atoms, for what a deck does between two runs (invariant I9).
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "bed.h"
#include "per_granule.h"

namespace solidcull {

/// Stored granules come out as guests, while bodies, store and frozen contacts stay as they are. What the deck left alone goes
/// back at once. What it changed wakes with all that is near, and then has the state that the deck gave it.
class ShownBed : public FollowsAtoms {
 public:
  explicit ShownBed(Bed& bed) : bed_(bed) {}

  bool shown() const { return shown_; }
  /// Whether owned atom i is a stored granule that is shown. Local.
  bool is_guest(int i) const {
    if (!shown_) return false;
    const Name& name = names_[static_cast<std::size_t>(i)];
    return name.home != nobody && (name.home != bed_.ranks.me || granules_[static_cast<std::size_t>(name.number)].stored);
  }
  /// Contact histories are up to date, and there are no ghosts. Local.
  void show();
  /// The interface granules as they were shown: commands may have deleted some or sent them elsewhere. Local.
  void stand_in_for_missing(Arrivals& arrivals) const;
  /// The engine has the contacts within bodies too, as long as it computes forces of all granules. Then it has them no more.
  /// Local.
  void give_contacts();
  void take_contacts();
  /// Guests go; what was changed asks to wake. Collective.
  void hide();
  /// All engine groups, as bits, of the guests that hide() saw. Local.
  int groups_of_guests() const { return groups_of_guests_; }
  /// Whether hide() found changes that wait for give_changes(), on any rank.
  bool changed() const { return changed_; }
  /// After the membership change in which they woke: granules have what the deck gave them, or are deleted. Collective.
  void give_changes();

  void grow(int room) override;
  void copy(int from, int to) override;
  void reset(int i) override;
  int packed_size() const override { return shown_ ? 2 : 0; }
  void pack(int i, double* to) const override;
  void unpack(int i, const double* from) override;
  void fit(int room) override { grow(room); }

 private:
  static constexpr int nobody = -1, gone = -1;
  /// Which of the granules it is that a rank has shown.
  struct Name {
    int home = nobody;
    std::int32_t number = 0;
  };
  struct Shown {
    std::int64_t tag;
    bool stored, of_clump, has_been_away;  // has_been_away: on another rank
    Vec3 place, velocity, spin;            // as shown
    double radius, mass;
    int type;
    std::uint64_t sum;  // of all its numbers but those of its motion, as shown
  };
  struct Interface {
    Locked state;
    Vec3 velocity, spin;  // that of its body
  };
  struct KnownContacts {
    std::int64_t tag;
    std::vector<std::int64_t> partners;
    std::vector<double> numbers;
  };
  struct Change {
    bool deleted = false, moved = false;  // moved: by the deck
    int layout = 0;
    std::vector<double> record;
  };

  void show_clump(int sphere, std::int64_t tag, Clump clump, int body, bool as_it_was);
  void join_images();
  void take_clumps(const std::vector<int>& at);
  void show_interface();
  void show_stored();
  void note(int i, bool stored, bool of_clump, std::uint64_t sum);
  static KnownContacts contacts_of(const HistoryRows& rows, int i, std::int64_t tag);
  KnownContacts contacts_in_body(std::int64_t tag, bool stored, int body) const;
  void give(int i, const KnownContacts& contacts);
  std::uint64_t sum_of(const std::vector<double>& record) const;
  bool is_as_shown(const Shown& s, int i) const;
  void bring_strangers_home(std::vector<int>& at);
  void add_numbers_of_clump(std::int64_t tag);
  void judge(std::size_t number, int i);
  void give(int i, const Change& change);

  Bed& bed_;

  bool shown_ = false, changed_ = false;
  int groups_of_guests_ = 0;
  std::vector<Name> names_;           // by atom
  std::vector<Shown> granules_;       // by number
  std::vector<Interface> interface_;  // by number: the first ones are interface granules
  std::vector<int> motion_words_;     // of a record, in their order
  std::vector<double> record_;        // of one granule
  std::vector<KnownContacts> outer_;  // of interface granules, while those within bodies are given
  struct ShownClump {
    std::int64_t tag;             // of the sphere that has its mass
    std::size_t number;           // of that sphere
    std::vector<double> numbers;  // of the clump, as shown
  };
  std::map<int, ShownClump> clumps_;          // by number of the clump
  std::map<int, Clump> changed_clumps_;       // likewise: as the deck has left them
  std::vector<std::pair<int, int>> spheres_;  // that are shown, and their clumps
  std::vector<Vec3> asking_;                  // places of those that are to wake
  std::map<std::int64_t, Change> changes_;
};

}  // namespace solidcull
