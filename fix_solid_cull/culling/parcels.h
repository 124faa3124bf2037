// Granules with their bodies and contacts: as numbers to the rank that owns a place now, and taken up there, or out of a restart
// file.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "bed.h"
#include "cover.h"

namespace solidcull {

/// A rank that sent or wrote granules, with its bodies.
struct Sender {
  int rank = 0;
  Pose observer, observed_then;  // see Cover
  std::vector<SolidBody> bodies;
};

/// Granules and contacts of one rank. What its pointers point to must outlive it.
struct Parcel {
  static constexpr int no_record = -1;
  /// `body` is of the sender.
  struct Granule : StoredGranule {
    const double* record = nullptr;  ///< of an interior granule; none of an interface granule
    int length = 0;
    std::vector<WallLoad> wall_loads;  ///< of an interior granule that was put away at walls
  };
  struct Edge {
    std::int64_t low, high;
    int body;
    const double* history;  ///< as low sees it, frame of the body; or none
  };
  std::shared_ptr<const Sender> sender;
  std::vector<Granule> granules;
  std::vector<Edge> edges;
  bool for_this_rank = false;  ///< all of them, wherever their places are
};

/// The only way in which granules come to a rank that did not lock them.
class Parcels {
 public:
  Parcels(Bed& bed, Cover& cover) : bed_(bed), cover_(cover) {}

  /// Stored granules and interface granules with their bodies, and contacts of theirs. Local.
  std::vector<double> pack(const std::vector<std::int64_t>& stored, const std::vector<std::int64_t>& interface_tags) const;
  /// width: numbers of a contact history. Local.
  std::vector<Parcel> unpack(const double* numbers, std::size_t n, std::size_t width);

  /// What was sent to this rank is its own, with the motion that it has in its bodies, and is tied together anew. Collective.
  void take_up(const std::vector<Parcel>& parcels) {
    begin_taking();
    take(parcels.data(), parcels.size());
    end_taking();
  }
  /// The same in many pieces; a contact comes with the later one of its granules, or before, or alone: with the history in the
  /// world, as `low` sees it, or none. Local, but for the end.
  void begin_taking() { bed_.solid.stands_otherwise(); }
  void take(const Parcel* parcels, std::size_t n);
  void take_contact(std::int64_t low, std::int64_t high, const double* history);
  void end_taking();

  /// Everything as it was on the rank that wrote it: first its bodies, then its parcels, in the order in which
  /// they were written. Local, but for the end.
  void begin_as_it_was(const Sender& sender);
  void take_as_it_was(const Parcel& parcel);
  void end_as_it_was();

 private:
  struct Taken {
    const Parcel* parcel;
    const Parcel::Granule* granule;
  };
  StoredGranule locked_before(StoredGranule g) const;
  void take_granule(std::int64_t tag, const Taken& t);
  void take_contacts(const Parcel& parcel, const std::map<std::int64_t, Taken>& taken);

  Bed& bed_;
  Cover& cover_;
  std::vector<std::int64_t> taken_in_;  // stored granules, until the end
  std::vector<int> number_;             // here, of the sender's bodies
};

}  // namespace solidcull
