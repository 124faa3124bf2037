// The culled state in a restart file: a few numbers in the file's head, and the section with what is culled at its end.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "bed.h"
#include "effective_gravity.h"
#include "parcels.h"
#include "section_chunks.h"
#include "store_section.h"

namespace solidcull {

/// Writes the file's state, and reads it back: as it was, where each rank has what it wrote, else to whoever owns it now.
class Snapshot {
 public:
  Snapshot(Bed& bed, Parcels& parcels, EffectiveGravity& gravity, const Cover& cover)
      : bed_(bed), parcels_(parcels), gravity_(gravity), cover_(cover) {}

  /// On rank 0 the numbers for the file's head, the first of them how many they are; empty elsewhere. Says once a run what the
  /// file holds, and again where a run begins. Collective.
  std::vector<double> write(bool run_begins);
  /// The section that goes with them, at the end of the file; nothing may have changed since. InputError where it could not be
  /// written. Collective.
  void append_to(const std::string& file);

  /// What write() gave, of its bytes, which need not be aligned. InputError for what another version wrote, or what is not what
  /// was written. Local.
  static std::vector<double> from_bytes(const char* bytes);
  /// Granules that the file holds besides atoms, and clumps that it holds besides their spheres.
  static std::int64_t interior_of(const std::vector<double>& state);
  /// Scales, counters and largest radii are known at once, the rest waits in the file for take_up(). InputError for a file whose
  /// section is not there, or is that of another file. Collective.
  void read(const std::vector<double>& state, const std::string& file);
  bool waits() const { return !state_.empty(); }
  /// Once there are atoms. InputError for another contact model, or a damaged file. Collective.
  void take_up();
  /// Whether the walls are those of the file that was taken up: then what stored granules press on them is known. On all ranks
  /// the same.
  bool walls_are_as_they_were() const { return same_walls_; }
  /// Whether a file was taken up since this was asked last.
  bool take_taken_up() { return std::exchange(taken_up_, false); }

 private:
  bool stands_as_it_was(SectionReader& section) const;
  bool holds(const Parcel& parcel) const;
  void check_counts(const SectionCounts& due, const SectionCounts& taken) const;
  SectionCounts take_as_it_was(SectionReader& section);

  Bed& bed_;
  Parcels& parcels_;
  EffectiveGravity& gravity_;
  const Cover& cover_;
  std::vector<double> state_;  // of the file's head
  std::string file_;           // that was read
  bool same_walls_ = false;    // when it was taken up
  bool taken_up_ = false;
  bool told_ = false;           // that files of this run hold more than atoms
  std::uint64_t identity_ = 0;  // of the file that is being written
};

}  // namespace solidcull
