// Granules with their bodies and contacts as numbers: into a restart file, out of one on any number of ranks, and to the rank
// that owns a place now.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "atom_index.h"
#include "body_groups.h"
#include "cover.h"
#include "granule_masses.h"
#include "ports.h"
#include "shell.h"
#include "solid.h"

namespace solidcull {

/// What one rank wrote. Its numbers must outlive it.
struct Parcel {
  static constexpr int no_record = -1;
  struct Granule {
    double mass, radius;
    bool held;
    int body;    ///< in `bodies`
    Vec3 place;  ///< in its frame (m)
    StoredGranule stored;
    const double* record = nullptr;  ///< of an interior granule; none of an interface granule
    int length = 0;
  };
  struct Edge {
    std::int64_t low, high;
    int body;
    std::vector<double> history;  ///< as low sees it, frame of the body
  };
  int rank;
  Pose observer, observed_then;  // see Cover
  std::vector<SolidBody> bodies;
  std::map<std::int64_t, Granule> granules;  ///< by tag
  std::vector<Edge> edges;
};

class Parcels {
 public:
  Parcels(const Ports& ports, const Scales& scales, Solid& solid, Shell& shell, AtomIndex& index, const GranuleMasses& masses,
          Arrivals& arrivals, BodyGroups& groups, Cover& cover)
      : ports_(ports),
        scales_(scales),
        solid_(solid),
        shell_(shell),
        index_(index),
        masses_(masses),
        arrivals_(arrivals),
        groups_(groups),
        cover_(cover) {}

  /// Stored granules and interface granules with their bodies, and contacts of theirs; `all`: everything that is locked here.
  /// Local.
  std::vector<double> pack(const std::vector<std::int64_t>& stored, const std::vector<std::int64_t>& interface_tags,
                           bool all) const;
  /// width: numbers of a contact history. Local.
  std::vector<Parcel> unpack(const double* numbers, std::size_t n, std::size_t width);

  /// Whether this rank holds all that is in it, and locked atoms that are in it only. Local.
  bool is_whole_rank(const Parcel& p) const;
  /// Everything as it was, to the last bit. Collective.
  void take_up_as_it_was(const Parcel& p);
  /// Each rank takes the granules whose places it owns, with the motion that they have in their bodies, and ties them together
  /// anew. Collective.
  void take_up(const std::vector<Parcel>& parcels);

 private:
  struct Taken {
    const Parcel* parcel;
    const Parcel::Granule* granule;
  };
  void take_granule(std::int64_t tag, const Taken& t);
  void take_contacts(const std::vector<Parcel>& parcels, const std::map<std::int64_t, Taken>& taken);

  const Ports& ports_;
  const Scales& scales_;
  Solid& solid_;
  Shell& shell_;
  AtomIndex& index_;
  const GranuleMasses& masses_;
  Arrivals& arrivals_;
  BodyGroups& groups_;
  Cover& cover_;
};

}  // namespace solidcull
