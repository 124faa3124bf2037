#include "clump_spheres.h"

#include <string>

namespace solidcull {
std::map<int, Clump> ClumpSpheres::near() const {
  std::map<int, Clump> near;
  if (!bed_.clumps.possible) return near;
  struct Row {
    Triple at;
    std::array<double, clump_numbers> numbers;
  };
  std::vector<Row> rows;
  std::vector<double> numbers;
  for (int k = 0; k < bed_.clumps.count(); ++k) {
    Clump c = bed_.clumps.clump(k);
    c.rest.clear();
    if (bed_.ranks.count > 1) {
      rows.push_back({triple(c.lies.centre), {}});
      numbers.clear();
      pack(c, numbers);
      std::copy(numbers.begin(), numbers.end(), rows.back().numbers.begin());
    }
    near.emplace(c.number, std::move(c));
  }
  if (bed_.ranks.count > 1)
    for (const Row& r : bed_.ranks.exchange(rows, reach())) {
      Clump c = unpack_clump(r.numbers.data(), 0);
      near.emplace(c.number, std::move(c));  // its centre may be in another periodic image: who asks takes the nearest one
    }
  return near;
}

std::vector<Clump> ClumpSpheres::take(const std::vector<std::pair<int, int>>& clumps_and_spheres) const {
  std::vector<Clump> taken;
  struct Row {
    Triple at;
    int clump, rank;
  };
  std::vector<Row> asked;
  std::map<int, std::size_t> due;
  for (const auto& [clump, sphere] : clumps_and_spheres) {
    due[clump] = taken.size();
    taken.emplace_back();
    if (bed_.clumps.find(clump) >= 0)
      taken.back() = bed_.clumps.take(clump);
    else
      asked.push_back({triple(bed_.atoms.place(sphere)), clump, bed_.ranks.me});
  }
  if (bed_.ranks.count > 1) {
    std::map<int, std::vector<double>> answers;
    for (const Row& r : bed_.ranks.exchange(asked, reach()))
      if (r.rank != bed_.ranks.me && bed_.clumps.find(r.clump) >= 0) pack(bed_.clumps.take(r.clump), answers[r.rank]);
    const std::size_t rest = static_cast<std::size_t>(bed_.clumps.rest_size), size = clump_numbers + rest;
    for (const auto& [rank, numbers] : bed_.ranks.deliver(answers))
      for (std::size_t at = 0; at < numbers.size(); at += size) {
        Clump c = unpack_clump(numbers.data() + at, rest);
        const std::size_t place = due.at(c.number);
        taken[place] = std::move(c);
      }
  }
  for (const auto& [clump, place] : due)
    if (taken[place].number != clump)
      throw InternalError("no rank moves clump " + std::to_string(clump) + ", which has spheres on this one");
  return taken;
}

}  // namespace solidcull
