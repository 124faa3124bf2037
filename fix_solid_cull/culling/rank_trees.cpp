#include "rank_trees.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <tuple>

namespace solidcull {

/// What a part tells another one that it is tied to.
struct RankTrees::Note {
  /// Who a row is for and of whom, by their numbers on their ranks.
  struct Address {
    int to, from;
  } address;
  std::int64_t key;
  int level;
  Neighbour parent;
  Triple shift;
};

/// A part while keys are still on their way.
struct RankTrees::Growing {
  const std::vector<PartLink>* links;
  std::vector<Note> heard;  // of each of them, in the last round
  Part part;
  Branch branch;
};

void RankTrees::clear() {
  parts_.clear();
  branches_.clear();
  downwards_.clear();
  place_.clear();
}

/// In each round each part tells those that it is tied to the smallest key that it has heard of and how far that is. Whoever is
/// farthest from it has heard after as many rounds as there are links in between: as a rule no more than ranks along the edges of
/// the grid.
void RankTrees::grow(const std::map<int, std::vector<PartLink>>& links, const Vec3& periods) {
  clear();
  std::map<int, Growing> growing;  // by body
  std::map<int, std::vector<Note>> out;
  for (const auto& [body, to] : links) {
    if (to.empty()) continue;
    Growing& g = growing[body];
    g.links = &to;
    g.heard.resize(to.size());
    g.part.body = body;
    g.part.key = own_key(body);
    for (const PartLink& l : to) out[l.rank];
  }
  const auto tell = [&] {
    for (auto& [rank, notes] : out) notes.clear();
    for (const auto& [body, g] : growing)
      for (const PartLink& l : *g.links)
        out[l.rank].push_back({{l.body, body}, g.part.key, g.branch.level, g.branch.parent, triple(g.part.shift)});
    for (const auto& [rank, notes] : out) ranks_.send_rows(rank, notes);
  };
  const auto hear = [&] {
    for (const auto& [rank, notes] : out) {
      for (const Note& n : ranks_.receive_rows<Note>(rank)) {
        const auto at = growing.find(n.address.to);
        if (at == growing.end()) throw InternalError("a part of a body is tied to one that is not there");
        const std::vector<PartLink>& to = *at->second.links;
        for (std::size_t l = 0; l < to.size(); ++l)
          if (to[l].rank == rank && to[l].body == n.address.from) at->second.heard[l] = n;
      }
    }
  };
  const auto choose = [&](Growing& g) {
    Part part = g.part;
    Branch branch;
    part.key = own_key(part.body);
    part.shift = Vec3::Zero();
    for (std::size_t l = 0; l < g.heard.size(); ++l) {
      const Note& n = g.heard[l];
      const PartLink& link = (*g.links)[l];
      const Neighbour other{link.rank, link.body};
      if (std::make_tuple(n.key, n.level + 1, other.rank, other.body) >=
          std::make_tuple(part.key, branch.level, branch.parent.rank, branch.parent.body))
        continue;
      part.key = n.key;
      part.shift = link.to_other + vec(n.shift);
      branch.level = n.level + 1;
      branch.parent = other;
    }
    const bool other = part.key != g.part.key || branch.level != g.branch.level || branch.parent.rank != g.branch.parent.rank ||
                       branch.parent.body != g.branch.parent.body || part.shift != g.part.shift;
    g.part = part;
    g.branch = branch;
    return other;
  };
  bool changed = false;
  do {
    for (int round = 0; round < ranks_.hops() + 2; ++round) {
      tell();
      hear();
      changed = false;
      for (auto& [body, g] : growing) changed = choose(g) || changed;
    }
  } while (ranks_.any(changed));

  std::vector<Growing> all;
  for (auto& [body, g] : growing) {
    for (std::size_t l = 0; l < g.heard.size(); ++l) {
      const Note& n = g.heard[l];
      const PartLink& link = (*g.links)[l];
      if (n.parent.rank == ranks_.me && n.parent.body == body && n.level > 0) g.branch.children.push_back({link.rank, link.body});
      const Vec3 round_about = link.to_other + vec(n.shift) - g.part.shift;
      for (int d = 0; d < 3; ++d)
        g.part.tied[d] = g.part.tied[d] || link.tied_anew[d] || (periods[d] > 0 && std::abs(round_about[d]) > 0.5 * periods[d]);
    }
    all.push_back(std::move(g));
  }
  const auto upwards = [](const Growing& g) { return std::make_tuple(g.part.key, -g.branch.level, g.part.body); };
  std::sort(all.begin(), all.end(), [&](const Growing& a, const Growing& b) { return upwards(a) < upwards(b); });
  for (Growing& g : all) {
    place_[g.part.body] = static_cast<int>(parts_.size());
    downwards_.push_back(parts_.size());
    parts_.push_back(g.part);
    branches_.push_back(std::move(g.branch));
  }
  // by key on all ranks alike, else two would wait for each other
  std::stable_sort(downwards_.begin(), downwards_.end(), [&](std::size_t a, std::size_t b) {
    return std::make_tuple(parts_[a].key, branches_[a].level) < std::make_tuple(parts_[b].key, branches_[b].level);
  });
}

void RankTrees::send(std::size_t part, const Neighbour& to, const void* row, std::size_t bytes) const {
  const Note::Address address{to.body, parts_[part].body};
  std::vector<char> message(sizeof address + bytes);
  std::memcpy(message.data(), &address, sizeof address);
  std::memcpy(message.data() + sizeof address, row, bytes);
  ranks_.send(to.rank, message.data(), message.size());
}

/// Rows of several bodies may come from one rank in another order than they are asked for.
void RankTrees::receive(std::size_t part, const Neighbour& from, void* row, std::size_t bytes) const {
  const std::array<int, 3> wanted{from.rank, parts_[part].body, from.body};
  std::vector<char> message;
  const auto early = early_.find(wanted);
  if (early != early_.end()) {
    message = std::move(early->second);
    early_.erase(early);
  }
  while (message.empty()) {
    message = ranks_.receive(from.rank);
    Note::Address address;
    if (message.size() != sizeof address + bytes) throw InternalError("a row of a body over ranks has a wrong size");
    std::memcpy(&address, message.data(), sizeof address);
    if (address.to == wanted[1] && address.from == wanted[2]) break;
    early_[{from.rank, address.to, address.from}] = std::move(message);
    message.clear();
  }
  std::memcpy(row, message.data() + sizeof(Note::Address), bytes);
}

}  // namespace solidcull
