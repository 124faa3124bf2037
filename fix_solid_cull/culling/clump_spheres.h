// Which spheres are one granule: those of a clump are locked, stored, freed and judged together (theory.md#clumps).
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "bed_state.h"
#include "clump_numbers.h"

namespace solidcull {

/// What ranks know together of the clumps whose spheres they have. Nothing is asked of ranks where there are no clumps.
class ClumpSpheres {
 public:
  explicit ClumpSpheres(const BedState& bed) : bed_(bed) {}

  /// The clump that owned atom i is a sphere of, exterior or locked; 0: none. Local.
  int of(int i) const { return bed_.shell.locked(i) ? bed_.shell[i].clump : bed_.clumps.of(i); }

  /// Each number of an owned atom becomes what those of all spheres of its clump are united to, on whatever rank they are:
  /// unite(T& one, const T& other) must not mind their order. Collective.
  template <class T, class Unite>
  void unite(std::vector<T>& of_atom, Unite unite) const {
    if (!bed_.clumps.possible) return;
    struct Row {
      Triple at;
      int clump, rank;
      T value;
    };
    static_assert(std::is_trivially_copyable<T>::value, "ranks exchange it");
    FlatMap<int> place;  // by clump
    std::vector<Row> own;
    for (int i = 0; i < bed_.atoms.owned; ++i) {
      const int clump = of(i);
      if (clump == 0) continue;
      const T& value = of_atom[static_cast<std::size_t>(i)];
      if (const int* known = place.find(clump)) {
        unite(own[static_cast<std::size_t>(*known)].value, value);
      } else {
        place[clump] = static_cast<int>(own.size());
        own.push_back({triple(bed_.atoms.place(i)), clump, bed_.ranks.me, value});
      }
    }
    if (bed_.ranks.count > 1) {
      std::map<std::pair<int, int>, T> others;  // by clump and rank: images come once
      for (const Row& r : bed_.ranks.exchange(own, reach()))
        if (r.rank != bed_.ranks.me && place.find(r.clump)) others.emplace(std::make_pair(r.clump, r.rank), r.value);
      for (const auto& [key, value] : others) unite(own[static_cast<std::size_t>(*place.find(key.first))].value, value);
    }
    for (int i = 0; i < bed_.atoms.owned; ++i)
      if (const int clump = of(i)) of_atom[static_cast<std::size_t>(i)] = own[static_cast<std::size_t>(*place.find(clump))].value;
  }
  /// Flags that hold for a clump if they hold for all of its spheres, or for any. Collective.
  void all_of(std::vector<char>& flags) const {
    unite(flags, [](char& one, char other) { one = one && other; });
  }
  void any_of(std::vector<char>& flags) const {
    unite(flags, [](char& one, char other) { one = one || other; });
  }

  /// Of these owned atoms stay what is no sphere of a clump, and whole clumps. Collective.
  void keep_whole(std::vector<int>& atoms) const {
    std::vector<char> stays(static_cast<std::size_t>(bed_.atoms.owned), 0);
    for (const int i : atoms) stays[i] = 1;
    all_of(stays);
    atoms.erase(std::remove_if(atoms.begin(), atoms.end(), [&](int i) { return !stays[i]; }), atoms.end());
  }

  /// The clumps whose spheres this rank has, by number, as the rank that moves them knows them; `rest` is left out. Collective.
  std::map<int, Clump> near() const;
  /// Those with these numbers, which have a sphere here, as near() tells them; they leave the engine of the rank that moves them
  /// and come here, whole. InternalError where none does. Collective.
  std::vector<Clump> take(const std::vector<std::pair<int, int>>& clumps_and_spheres) const;

  /// Farthest that two spheres of one clump may be apart, with what they may have gone since the last build (m). Local.
  double reach() const { return bed_.largest_clump + bed_.run.skin; }

 private:
  const BedState& bed_;
};

}  // namespace solidcull
