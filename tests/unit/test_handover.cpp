#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <map>
#include <mutex>
#include <set>
#include <type_traits>

#include "input_error.h"
#include "section_file.h"
#include "tag_owners.h"
#include "world_parts.h"

namespace solidcull {
namespace {

SmallDeck ranks_along_x(int ranks) {
  SmallDeck deck;
  deck.gravity = Vec3::Zero();
  deck.box = {Vec3(-0.12, -0.1, -0.1), Vec3(0.12, 0.1, 0.1)};
  deck.split = {ranks, 1, 1};
  return deck;
}

/// Those of a stored granule's numbers that mean the same on each rank, in each frame, and nothing to the rest of the culling:
/// all that a new one is until it is used. Calls visit(number).
template <class Visit>
void each_free_number(StoredGranule& g, Visit visit) {
  g.each_number([&](auto& x) {
    std::vector<const void*> used = {&g.position[0], &g.position[1],    &g.position[2],    &g.radius,         &g.mass,
                                     &g.layout,      &g.load_change[0], &g.load_change[1], &g.load_change[2], &g.type,
                                     &g.held,        &g.clump,          &g.spheres,        &g.has_clump};
    g.each_of_clump([&](double& n) { used.push_back(&n); });
    if (std::find(used.begin(), used.end(), static_cast<const void*>(&x)) == used.end()) visit(x);
  });
}

/// What all ranks hold together.
struct Whole {
  std::mutex mutex;
  int interior = 0, interface_granules = 0;
  double mass = 0, colour = 0;
  Vec3 momentum = Vec3::Zero(), turning = Vec3::Zero();
  std::map<int, Vec3> places;                                      // by tag
  std::map<int, std::vector<double>> numbers;                      // of stored granules
  std::map<std::pair<std::int64_t, std::int64_t>, Vec3> contacts;  // as the lower tag sees it, world frame
  std::set<std::int64_t> keys;                                     // of bodies
  std::vector<int> tags_by_rank[8];

  void add(SmallWorld& w, WorldParts& parts) {
    const std::lock_guard<std::mutex> lock(mutex);
    const SolidBodies& bodies = parts.bed.solid.bodies();
    const auto one = [&](int tag, double m, double radius, const Vec3& x, int body) {
      const Twist& twist = bodies.body(body).twist;
      const RigidPart p = RigidPart::granule(m, radius, x, twist.at(x), twist.spin);
      mass += m;
      momentum += m * p.velocity;
      turning += p.angular_momentum(Vec3::Zero());
      EXPECT_TRUE(places.emplace(tag, x).second) << "two ranks hold granule " << tag;
      tags_by_rank[w.ranks.me].push_back(tag);
    };
    for (int i = 0; i < w.atoms.owned; ++i) {
      if (!parts.bed.shell[i].in_body()) continue;
      ++interface_granules;
      const int body = parts.bed.shell[i].body;
      EXPECT_EQ(body, bodies.body_of(w.atoms.tag[i]));
      const Vec3 x = bodies.pose(body).to_world(parts.bed.shell[i].place);
      EXPECT_LT((x - w.atoms.place(i)).norm(), 1e-12);
      one(w.atoms.tag[i], w.atoms.mass[i], w.atoms.radius[i], x, body);
    }
    parts.bed.solid.store().for_each([&](const Resident& g) {
      ++interior;
      one(static_cast<int>(g.tag), parts.bed.solid.store().get(g.tag).mass, g.radius, parts.bed.solid.in_world(g), g.body);
      std::vector<double> record;
      parts.bed.solid.store().record(g.tag, record);
      colour += record.back();
      StoredGranule stored = parts.bed.solid.store().get(g.tag);
      each_free_number(stored, [&](auto& x) { numbers[static_cast<int>(g.tag)].push_back(static_cast<double>(x)); });
    });
    const auto contact = [&](std::int64_t low, std::int64_t high, const double* h) {
      const int body = bodies.body_of(low) ? bodies.body_of(low) : bodies.body_of(high);
      const Vec3 history = h ? Vec3(bodies.pose(body).turn() * vec(h)) : Vec3(Vec3::Zero());
      const auto known = contacts.emplace(std::make_pair(low, high), history);
      EXPECT_LT((known.first->second - history).norm(), 1e-15);  // on both sides of a border
    };
    parts.bed.solid.contacts().for_each_contact(contact);
    parts.bed.solid.store().for_each([&](const Resident& g) {
      parts.bed.solid.contacts().for_each_elsewhere(g.tag, [&](std::int64_t partner) {
        double h[3];
        if (partner < g.tag) return;
        contact(g.tag, partner, parts.bed.solid.inner_history(g, partner, h) ? h : nullptr);
      });
    });
    for (const auto& b : bodies.bodies()) keys.insert(parts.bed.groups.key_of(b.first));
  }
};

void expect_alike(const Whole& a, const Whole& b) {
  EXPECT_EQ(a.interior, b.interior);
  EXPECT_EQ(a.interface_granules, b.interface_granules);
  EXPECT_NEAR(a.mass, b.mass, 1e-12 * b.mass);
  EXPECT_NEAR(a.colour, b.colour, 1e-9);
  EXPECT_LT((a.momentum - b.momentum).norm(), 1e-9 * b.momentum.norm());
  EXPECT_LT((a.turning - b.turning).norm(), 1e-9 * b.turning.norm());
  EXPECT_EQ(a.keys.size(), b.keys.size());
  ASSERT_EQ(a.places.size(), b.places.size());
  for (const auto& [tag, x] : b.places) EXPECT_LT((a.places.at(tag) - x).norm(), 1e-12) << tag;
  EXPECT_EQ(a.numbers, b.numbers);
  ASSERT_EQ(a.contacts.size(), b.contacts.size());
  for (const auto& [pair, h] : b.contacts)
    EXPECT_LT((a.contacts.at(pair) - h).norm(), 1e-12 * h.norm()) << pair.first << ' ' << pair.second;
}

/// A block of 6 x 2 x 2 granules from x on, one body that moves and turns; the inner ones are stored.
struct Block {
  Block(SmallWorld& w, double from) : world(w), parts(w, sleeping_settings(), 2 * r) {
    for (int n = 0; n < 24; ++n) {
      const Vec3 x = Vec3(from, 0, 0) + pressed * Vec3(n % 6, n / 6 % 2, n / 12);
      world.add(n + 1, x, r, Vec3(0.1, 0, 1e-4 * n), Vec3(0, 0, 1e-2));
      tags.push_back(n + 1);
    }
    world.begin_run(nullptr);
    world.steps(nullptr, 10);
    world.reneighbour();  // whoever has crossed a border by now does so as an exterior granule
    parts.lock(tags);
    parts.put_away({2, 3, 4, 5, 8, 9, 10, 11, 14, 15});
    mark_stored();
    parts.reneighbour();
  }
  /// Each free number of each stored granule is another one.
  void mark_stored() {
    std::vector<std::int64_t> stored;
    parts.bed.solid.store().for_each([&](const Resident& g) { stored.push_back(g.tag); });
    for (const std::int64_t tag : stored) {
      std::vector<double> record;
      StoredGranule g = parts.bed.solid.bring_back(tag, record);
      int n = 0;
      each_free_number(g, [&](auto& x) { x = static_cast<std::decay_t<decltype(x)>>(100 * tag + ++n); });
      EXPECT_GE(n, 3);
      parts.bed.solid.put_away(g, record, {}, {});
    }
  }
  void shift(const Vec3& by) {
    for (auto& [number, body] : parts.bed.solid.bodies_in_motion()) {
      body.shift(by);
      body.take_twist();
    }
    parts.motion.begin_lists();
    parts.motion.refresh();
    parts.motion.place();
  }
  SmallWorld& world;
  WorldParts parts;
  std::vector<std::int64_t> tags;
};

TEST(Handover, granules_go_to_the_rank_that_owns_their_place_and_nothing_is_lost) {
  for (const int ranks : {2, 3}) {
    Whole before, after;
    run_on_ranks(ranks_along_x(ranks), [&](SmallWorld& w) {
      Block block(w, -0.06);
      block.shift(Vec3(0.031, 0, 0));
      before.add(w, block.parts);
      block.parts.bed.index.index(w.atoms);
      EXPECT_TRUE(block.parts.send_home());
      block.parts.reneighbour();
      after.add(w, block.parts);
      block.parts.bed.census.count_bodies();
      EXPECT_NO_THROW(block.parts.invariants.check());
      block.parts.bed.index.index(w.atoms);
      EXPECT_FALSE(block.parts.send_home());  // all are at home
    });
    EXPECT_EQ(before.interior, 10);
    EXPECT_EQ(before.interface_granules, 14);
    EXPECT_GE(before.contacts.size(), 40u);
    expect_alike(after, before);
    EXPECT_EQ(after.keys.size(), 1u);
    // each where its place is: columns of the block at -0.029 + 0.01 n
    const double border = ranks == 2 ? 0.0 : -0.04;
    for (const int tag : after.tags_by_rank[0]) EXPECT_LT(after.places[tag][0], border);
    for (const int tag : after.tags_by_rank[1]) EXPECT_GE(after.places[tag][0], border);
    EXPECT_FALSE(after.tags_by_rank[1].empty());
  }
}

TEST(Handover, what_lags_behind_by_less_than_the_slack_may_wait) {
  run_on_ranks(ranks_along_x(2), [&](SmallWorld& w) {
    Block block(w, -0.065);  // its last column at -0.0151
    block.parts.bed.index.index(w.atoms);
    block.parts.send_home();
    block.parts.reneighbour();
    block.shift(Vec3(0.3 * 2 * r, 0, 0));
    block.parts.bed.index.index(w.atoms);
    EXPECT_FALSE(block.parts.send_home());
  });
}

/// Each way alone is less than half the slack, a granule's diameter.
TEST(Handover, what_merges_lags_behind_by_the_ways_of_both_bodies) {
  run_on_ranks(ranks_along_x(2), [&](SmallWorld& w) {
    constexpr double d = 2 * r;
    for (int n = 0; n < 3; ++n) w.add(31 + n, Vec3(-0.45 * d - pressed * n, 0.05, 0), r);
    Block block(w, -0.065);
    WorldParts& parts = block.parts;
    parts.lock({31, 32, 33});
    parts.put_away({31});
    parts.reneighbour();
    ++w.run.step;
    parts.exchange.forget_past_motions();
    const auto looks = [&] {
      parts.bed.index.index(w.atoms);
      return parts.handover.stored_elsewhere();
    };
    const auto shift = [&](int tag) {
      if (const int body = parts.body_of(tag)) parts.bed.solid.body(body).shift(Vec3(0.3 * d, 0, 0));
    };
    looks();
    shift(31);
    EXPECT_TRUE(looks().empty());
    if (parts.body_of(1) && parts.body_of(31)) parts.bed.solid.tie(1, 31, parts.bed.masses.by_tag());
    parts.bed.adopt_places();
    EXPECT_EQ(parts.body_of(1), parts.body_of(31));
    EXPECT_TRUE(looks().empty());
    shift(1);
    const std::vector<std::int64_t> found = looks();
    EXPECT_EQ(std::count(found.begin(), found.end(), 31), w.ranks.me == 0);
  });
}

/// Its own motion is known for the step in which it was put away, and on this rank.
TEST(Handover, what_was_put_away_a_little_beyond_a_border_waits) {
  for (const bool at_once : {false, true})
    run_on_ranks(ranks_along_x(2), [&](SmallWorld& w) {
      constexpr double d = 2 * r;
      Settings compact = sleeping_settings();
      compact.store = Store::compact;
      for (int n = 0; n < 3; ++n) {
        w.add(31 + n, Vec3(-1e-5 - pressed * n, 0.05, 0), r, Vec3(0.01 * n, 0.02, 0));
        w.add(41 + n, Vec3(-1e-5 - pressed * n, -0.05, 0), r);
      }
      WorldParts parts(w, compact, d);
      w.begin_run(nullptr);
      // since the last exchange, and the second one by far
      for (const auto& [tag, way] : {std::pair(31, 2e-5), std::pair(41, 0.4 * d)})
        if (w.at(tag) >= 0) w.atoms.set_place(w.at(tag), w.atoms.place(w.at(tag)) + Vec3(way, 0, 0));
      const Vec3 before = w.at(31) >= 0 ? w.atoms.velocity(w.at(31)) : Vec3(Vec3::Zero());
      parts.lock({31, 32, 33, 41, 42, 43});
      parts.put_away({31, 41});
      parts.bed.index.index(w.atoms);
      EXPECT_TRUE(parts.send_home());
      EXPECT_EQ(parts.bed.solid.store().contains(31), w.ranks.me == 0);
      EXPECT_EQ(parts.bed.solid.store().contains(41), w.ranks.me == 1);
      if (at_once) {
        Wakes all;
        all.all = Woke::deck;
        parts.change(all, {});
        if (w.ranks.me == 0) {
          EXPECT_EQ(w.atoms.velocity(w.at(31)), before);
        }
        return;
      }
      ++w.run.step;
      parts.exchange.forget_past_motions();
      if (const int body = parts.body_of(31)) parts.bed.solid.body(body).shift(Vec3(0.3 * d, 0, 0));
      const std::vector<std::int64_t> found = parts.handover.stored_elsewhere();
      EXPECT_EQ(std::count(found.begin(), found.end(), 31), w.ranks.me == 0);
    });
}

TEST(Handover, an_interface_granule_that_was_announced_and_does_not_come_has_left_its_body) {
  run_on_ranks(ranks_along_x(2), [&](SmallWorld& w) {
    Block block(w, -0.06);
    block.shift(Vec3(0.031, 0, 0));
    block.parts.bed.index.index(w.atoms);
    block.parts.send_home();
    block.parts.handover.remember();
    // the engine takes it along to the next rank only, and drops it where it has gone farther
    for (int i = w.atoms.owned - 1; i >= 0; --i)
      if (!w.ranks.owns(w.atoms.place(i))) w.atoms.take_out(i);
    std::vector<std::int64_t> announced;
    for (const std::int64_t tag : block.tags)
      if (block.parts.bed.arrivals.find(tag)) announced.push_back(tag);
    EXPECT_EQ(announced.empty(), w.ranks.me == 0);
    EXPECT_EQ(block.parts.handover.take_over(), announced.size());
    EXPECT_TRUE(w.ranks.any(block.parts.handover.forget_lost()));
    block.parts.bed.index.index(w.atoms);
    for (const std::int64_t tag : announced) EXPECT_EQ(block.parts.body_of(tag), 0);
    block.parts.bed.groups.settle();
    block.parts.bed.census.count_bodies();
    EXPECT_NO_THROW(block.parts.invariants.check());
    EXPECT_FALSE(block.parts.handover.forget_lost());
  });
}

TEST(Handover, what_leaves_the_box_beside_another_rank_is_announced_to_nobody) {
  run_on_ranks(ranks_along_x(2), [&](SmallWorld& w) {
    Block block(w, -0.06);
    block.shift(Vec3(0.031, 0.1, 0));  // half of it is beyond a side of the box, and some of that beside the other rank
    block.parts.bed.index.index(w.atoms);
    block.parts.closure.fetch_from_outside();
    block.parts.send_home();
    block.parts.handover.remember();
    w.exchange();
    EXPECT_EQ(block.parts.handover.take_over(), 0u);
    EXPECT_TRUE(w.ranks.any(block.parts.handover.forget_lost()));
    block.parts.bed.index.index(w.atoms);
    block.parts.bed.groups.settle();
    block.parts.bed.census.count_bodies();
    EXPECT_NO_THROW(block.parts.invariants.check());
  });
}

TEST(Handover, an_interface_granule_that_comes_without_its_body_is_an_internal_error) {
  run_on_ranks(ranks_along_x(2), [&](SmallWorld& w) {
    Block block(w, -0.06);
    block.shift(Vec3(0.031, 0, 0));
    w.exchange();  // nobody has announced them
    if (w.ranks.me == 0) return;
    EXPECT_THROW(block.parts.handover.take_over(), InternalError);
  });
}

// ------------------------------------------------------------------------------------------------------------ snapshot

/// The engine's side of a restart file: atoms, with what follows them.
struct File : SectionFile {
  struct Atom {
    std::vector<double> record;
    std::vector<std::vector<double>> followers;
  };
  std::vector<Atom> atoms;

  void write(SmallWorld& w, WorldParts& parts) {
    const std::vector<double> numbers = parts.snapshot.write(false);
    EXPECT_EQ(numbers.empty(), w.ranks.me != 0);
    parts.snapshot.append_to(end);
    const std::lock_guard<std::mutex> lock(mutex);
    if (!numbers.empty()) state = numbers;
    for (int i = 0; i < w.atoms.owned; ++i) {
      Atom a;
      int layout = 0;
      w.atoms.pack(i, a.record, layout);
      for (FollowsAtoms* f : w.atoms.followers) {
        a.followers.emplace_back(static_cast<std::size_t>(f->packed_size()));
        f->pack(i, a.followers.back().data());
      }
      atoms.push_back(a);
    }
  }
  void read(SmallWorld& w, WorldParts& parts) const {
    for (const Atom& a : atoms) {
      if (!w.ranks.owns(vec(a.record.data()))) continue;
      const int i = w.atoms.put_back(a.record, 0);
      for (std::size_t f = 0; f < a.followers.size(); ++f) w.atoms.followers[f]->unpack(i, a.followers[f].data());
    }
    parts.snapshot.read(Snapshot::from_bytes(reinterpret_cast<const char*>(state.data())), end);
    EXPECT_TRUE(parts.snapshot.waits());
    parts.snapshot.take_up();
    EXPECT_FALSE(parts.snapshot.waits());
  }
};

std::string bytes_of(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// What the section holds, by rank and kind of chunk, whatever the order of its granules.
std::multiset<std::vector<std::uint64_t>> rows_of(const File& file) {
  std::multiset<std::vector<std::uint64_t>> rows;
  SmallWorld alone(ranks_along_x(1));
  const auto half = [&](std::size_t back) { return static_cast<std::uint64_t>(file.state[file.state.size() - back]); };
  SectionReader section(alone.ranks, file.end, half(7) << 32 | half(6));  // types, two radii and the check sum follow
  std::vector<ChunkPlace> chunks;
  for (std::size_t p = 0; p < section.parts().size(); ++p)
    for (const ChunkPlace& c : section.list(p)) chunks.push_back(c);
  SectionChunk chunk;
  for (const ChunkPlace& c : chunks) {
    EXPECT_TRUE(section.read(c, chunk));
    const char *at = chunk.bytes.data(), *const end = at + chunk.bytes.size();
    const auto tables = [&](std::uint64_t n) {
      for (WordTable t; n > 0; --n) {
        at = unpack_columns(at, end, t);
        for (std::size_t r = 0; r < t.rows; ++r) {
          std::vector<std::uint64_t> row = {chunk.rank, chunk.kind};
          row.insert(row.end(), t.row(r), t.row(r) + t.columns);
          rows.insert(row);
        }
      }
    };
    tables(chunk.kind == SectionChunk::part ? 3 : 2);
    if (chunk.kind == SectionChunk::interior_granules) {
      std::uint64_t more = 0;
      std::memcpy(&more, at, sizeof more);
      at += sizeof more;
      tables(more);
    }
    if (static_cast<std::size_t>(end - at) >= sizeof(std::uint64_t)) tables(1);  // of walls
  }
  return rows;
}

TEST(Snapshot, what_two_ranks_wrote_is_taken_up_by_any_number_of_ranks) {
  File file;
  Whole written;
  run_on_ranks(ranks_along_x(2), [&](SmallWorld& w) {
    Block block(w, -0.03);
    block.parts.bed.solid.count_carves(3);  // on each of two
    written.add(w, block.parts);
    file.write(w, block.parts);
  });
  ASSERT_EQ(written.interior, 10);
  for (const int ranks : {1, 2, 3}) {
    Whole read;
    run_on_ranks(ranks_along_x(ranks), [&](SmallWorld& w) {
      WorldParts parts(w, sleeping_settings(), 1.0);  // the scales are the file's
      file.read(w, parts);
      EXPECT_EQ(parts.bed.scales.diameter(), 2 * r);
      parts.reneighbour();
      read.add(w, parts);
      EXPECT_NO_THROW(parts.invariants.check());
      const Ledger& ledger = parts.bed.solid.ledger();
      std::int64_t counters[3] = {ledger.granules_locked(), ledger.granules_restored(), ledger.carves()};
      w.ranks.sum(counters, 3);
      EXPECT_EQ(counters[0], 24);
      EXPECT_EQ(counters[1], 0);
      EXPECT_EQ(counters[2], 6);
      EXPECT_EQ(parts.bed.solid.largest_radius_by_type()[1], r);
    });
    expect_alike(read, written);
  }
}

/// A body that stood does not have to come to rest anew, which may take it a while, and some way.
TEST(Snapshot, a_body_that_stood_stands_on_any_number_of_ranks) {
  SmallDeck deck = ranks_along_x(2);
  deck.planes = {SmallDeck::ground(-0.999 * r)};
  File file;
  run_on_ranks(deck, [&](SmallWorld& w) {
    WorldParts parts(w, sleeping_settings(), 2 * r);
    std::vector<std::int64_t> tags;
    for (int n = 0; n < 6; ++n) {
      w.add(n + 1, Vec3(-0.025 + pressed * n, 0, 0), r);
      tags.push_back(n + 1);
    }
    w.begin_run(nullptr);
    w.reneighbour();
    parts.walls.update(w.walls.contacts(), false);
    parts.lock(tags);
    parts.reneighbour();
    for (auto& [number, body] : parts.bed.solid.bodies_in_motion()) {
      ASSERT_GT(body.mass.held, 0);
      parts.bed.solid.ground(number, true);
    }
    parts.bed.groups.settle();
    file.write(w, parts);
  });
  for (const int ranks : {1, 2, 3}) {
    deck.split = {ranks, 1, 1};
    int bodies = 0;
    std::mutex mutex;
    run_on_ranks(deck, [&](SmallWorld& w) {
      WorldParts parts(w, sleeping_settings(), 1.0);
      file.read(w, parts);
      const std::lock_guard<std::mutex> lock(mutex);
      for (const auto& [number, body] : parts.bed.solid.bodies().bodies()) {
        EXPECT_TRUE(body.grounded) << ranks << " ranks";
        EXPECT_NEAR(body.grounded_mass, body.mass.mass, 1e-12 * body.mass.mass);
        ++bodies;
      }
    });
    EXPECT_GE(bodies, 1);
  }
}

/// The motions that they went in with are not in the file, though no step has passed.
TEST(Snapshot, what_was_stored_in_the_step_of_the_file_comes_back_with_the_motion_of_its_body) {
  File file;
  Vec3 momentum;
  {
    SmallWorld w(ranks_along_x(1));
    WorldParts parts(w, sleeping_settings(), 2 * r);
    for (int n = 0; n < 4; ++n) w.add(n + 1, Vec3(pressed * n, 0, 0), r, Vec3(0.3, 1e-4 * n, 0));
    w.reneighbour();
    w.compute_forces();
    momentum = w.momentum();
    parts.lock({1, 2, 3, 4});
    parts.put_away({2, 3});
    parts.reneighbour();
    file.write(w, parts);
  }
  SmallWorld w(ranks_along_x(1));
  WorldParts parts(w, sleeping_settings(), 2 * r);
  file.read(w, parts);
  parts.reneighbour();
  Wakes all;
  all.all = Woke::deck;
  parts.bed.index.index(w.atoms);
  parts.change(all, {});
  ASSERT_EQ(w.atoms.owned, 4);
  for (int tag = 1; tag <= 4; ++tag) EXPECT_NEAR(w.atoms.velocity(w.at(tag))[0], 0.3, 1e-12) << tag;
  EXPECT_LT((w.momentum() - momentum).norm(), 1e-12 * momentum.norm());
}

/// 22 x 6 x 6 granules, one body that turns; every fifth is an interface granule, and histories are what they were.
struct Slab {
  explicit Slab(SmallWorld& w) : parts(w, sleeping_settings(), 2 * r) {
    std::vector<std::int64_t> tags, stored;
    for (int n = 0; n < 792; ++n) {
      const int tag = 1 + 5 * n % 792;  // no order in space
      w.add(tag, Vec3(-0.11, -0.03, -0.03) + pressed * Vec3(n % 22, n / 22 % 6, n / 132), r, Vec3(0.01, 0, 1e-4 * (n % 22)),
            Vec3(0, 0, 1e-2));
      tags.push_back(tag);
      if (tag % 5 != 0) stored.push_back(tag);
    }
    w.begin_run(nullptr);
    w.steps(nullptr, 5);
    w.reneighbour();
    parts.lock(tags);
    parts.put_away(stored);
    parts.reneighbour();
    ++w.run.step;  // files of a later step than that in which they were locked keep all of their numbers
  }
  WorldParts parts;
};

SmallDeck grid_of_ranks(const std::array<int, 3>& split) {
  SmallDeck deck = ranks_along_x(1);
  deck.split = split;
  return deck;
}

/// Bytes that this thread has read from files; 0 where the system does not tell.
std::uint64_t read_by_this_thread() {
  std::ifstream in("/proc/thread-self/io");
  std::string name;
  std::uint64_t bytes = 0;
  in >> name >> bytes;
  return bytes;
}

/// Whoever reads gets, and reads, what is his, whatever the number of ranks and their grid.
TEST(Snapshot, no_rank_gets_more_than_its_part) {
  const std::vector<std::array<int, 3>> grids = {{1, 1, 1}, {2, 1, 1}, {1, 3, 1}, {4, 1, 1}, {2, 2, 1}, {2, 2, 2}};
  for (const auto& written_on : grids) {
    File file;
    Whole written;
    run_on_ranks(grid_of_ranks(written_on), [&](SmallWorld& w) {
      Slab slab(w);
      written.add(w, slab.parts);
      file.write(w, slab.parts);
    });
    ASSERT_EQ(written.interior, 634);
    ASSERT_GT(written.contacts.size(), 2000u);
    const double section = static_cast<double>(bytes_of(file.end).size());
    for (const auto& read_on : grids) {
      Whole read;
      double all_fetched = 0;
      run_on_ranks(grid_of_ranks(read_on), [&](SmallWorld& w) {
        WorldParts parts(w, sleeping_settings(), 2 * r);
        const std::uint64_t before = read_by_this_thread();
        w.ranks.delivered = 0;
        file.read(w, parts);
        const double received = static_cast<double>(w.ranks.delivered);
        const double fetched = static_cast<double>(read_by_this_thread() - before);
        const double here = static_cast<double>(parts.bed.solid.locked()) / 792 * section;
        EXPECT_LT(received, 1.5 * here + 4096);
        if (written_on == read_on || w.ranks.count == 1) {
          EXPECT_EQ(received, 0);
          EXPECT_LT(fetched, 1.1 * here + 4096);
        }
        {
          const std::lock_guard<std::mutex> lock(read.mutex);
          all_fetched += fetched;
        }
        parts.reneighbour();
        read.add(w, parts);
        EXPECT_NO_THROW(parts.invariants.check());
      });
      EXPECT_LT(all_fetched, 1.1 * section + 4096 * (read_on[0] * read_on[1] * read_on[2]));  // each chunk once
      expect_alike(read, written);
    }
  }
}

/// As a program that lays beds may write it: contacts after all granules, with none of theirs.
TEST(Snapshot, contacts_may_stand_with_neither_of_their_granules) {
  File file;
  Whole written;
  run_on_ranks(ranks_along_x(1), [&](SmallWorld& w) {
    Slab slab(w);
    written.add(w, slab.parts);
    file.write(w, slab.parts);
  });
  // the same section again, contacts of all chunks in one of their own
  SmallWorld alone(ranks_along_x(1));
  const auto half = [&](std::size_t back) { return static_cast<std::uint64_t>(file.state[file.state.size() - back]); };
  const std::uint64_t identity = half(7) << 32 | half(6);
  std::vector<SectionChunk> chunks;
  SectionCounts counts;
  {
    SectionReader section(alone.ranks, file.end, identity);
    counts = section.counts();
    ChunkTables last;
    for (const ChunkPlace& place : section.list(0)) {
      SectionChunk chunk;
      ASSERT_TRUE(section.read(place, chunk));
      if (place.kind != SectionChunk::part) {
        ChunkTables tables;
        tables.read(chunk);
        last.contacts.columns = tables.contacts.columns;
        last.contacts.rows += tables.contacts.rows;
        last.contacts.words.insert(last.contacts.words.end(), tables.contacts.words.begin(), tables.contacts.words.end());
        tables.contacts.clear(tables.contacts.columns);
        chunk.begin(chunk.kind, chunk.rank, chunk.granules);
        tables.append_to(chunk);
      }
      chunks.push_back(chunk);
    }
    SectionChunk chunk;
    chunk.begin(SectionChunk::interior_granules, 0, 0);
    last.append_to(chunk);
    chunks.push_back(chunk);
  }
  std::remove(file.end.c_str());
  SectionWriter out(alone.ranks, file.end, identity);
  for (const SectionChunk& chunk : chunks) EXPECT_TRUE(out.put(chunk));
  EXPECT_FALSE(out.put({}));
  out.close(counts);
  for (const int ranks : {2, 3}) {
    Whole read;
    run_on_ranks(ranks_along_x(ranks), [&](SmallWorld& w) {
      WorldParts parts(w, sleeping_settings(), 2 * r);
      file.read(w, parts);
      parts.reneighbour();
      read.add(w, parts);
      EXPECT_NO_THROW(parts.invariants.check());
    });
    expect_alike(read, written);
  }
}

TEST(Ranks, letters_come_to_those_they_are_for) {
  run_on_ranks(ranks_along_x(4), [](SmallWorld& w) {
    const std::map<int, std::vector<int>> letters_to_nobody;
    std::map<int, std::vector<int>> letters;
    if (w.ranks.me != 2) letters[3] = {w.ranks.me, 7};
    if (w.ranks.me == 3) letters[0] = {5};
    const std::map<int, std::vector<int>> came = w.ranks.deliver(letters);
    const std::map<int, std::vector<int>> to_0 = {{3, {5}}}, to_3 = {{0, {0, 7}}, {1, {1, 7}}, {3, {3, 7}}};
    EXPECT_EQ(came, w.ranks.me == 0 ? to_0 : w.ranks.me == 3 ? to_3 : letters_to_nobody);
  });
}

TEST(Ranks, whoever_knows_a_tag_finds_the_rank_that_has_it) {
  run_on_ranks(ranks_along_x(3), [](SmallWorld& w) {
    std::vector<std::int64_t> mine;
    for (int tag = 1; tag < 30; ++tag)
      if (tag / 10 == w.ranks.me) mine.push_back(tag);
    const TagOwners owners(w.ranks, mine);
    const std::vector<int> found =
        owners.of(w.ranks.me == 1 ? std::vector<std::int64_t>{} : std::vector<std::int64_t>{29, 3, 30, 12, 3});
    if (w.ranks.me == 1)
      EXPECT_TRUE(found.empty());
    else
      EXPECT_EQ(found, (std::vector<int>{2, 0, TagOwners::nobody, 1, 0}));
  });
}

TEST(Handover, contacts_that_join_bodies_of_one_rank_are_no_matter_of_the_next) {
  run_on_ranks(ranks_along_x(2), [](SmallWorld& w) {
    constexpr double r = 0.005;
    w.add(1, Vec3(-0.006, 0, 0), r);
    w.add(2, Vec3(-0.006, 2 * r, 0), r);
    w.add(3, Vec3(0.006, 0, 0), r);
    WorldParts parts(w, sleeping_settings(), 2 * r);
    parts.reneighbour();
    for (const std::int64_t tag : {1, 2, 3}) {
      parts.lock({tag});
      parts.reneighbour();
    }
    Proposal proposal;
    if (w.ranks.me == 0) {
      EXPECT_NE(parts.body_of(1), parts.body_of(2));
      proposal.joins = {{triple(Vec3(-0.006, 0, 0)), 1, 2}};
    }
    parts.change({}, proposal);
    EXPECT_EQ(parts.bed.solid.contacts().contains(1, 2), w.ranks.me == 0);
    if (w.ranks.me == 0) {
      EXPECT_EQ(parts.body_of(1), parts.body_of(2));
    }
  });
}

TEST(Snapshot, on_as_many_ranks_everything_is_as_it_was_to_the_last_bit) {
  for (const int ranks : {1, 2}) {
    File first, second;
    run_on_ranks(ranks_along_x(ranks), [&](SmallWorld& w) {
      Block block(w, -0.03);
      for (auto& [number, body] : block.parts.bed.solid.bodies_in_motion())
        for (int n = 0; n < 10; ++n) body.drift(1e-4);  // frames are turned
      block.shift(Vec3::Zero());
      first.write(w, block.parts);
    });
    run_on_ranks(ranks_along_x(ranks), [&](SmallWorld& w) {
      WorldParts parts(w, sleeping_settings(), 2 * r);
      first.read(w, parts);
      second.write(w, parts);
    });
    EXPECT_EQ(first.state, second.state) << ranks;
    EXPECT_TRUE(rows_of(first) == rows_of(second)) << ranks;
  }
}

/// Tags and loads in the order in which they are told, of all ranks, meshes by their names.
using LoadsByTag = std::map<std::int64_t, std::vector<std::pair<std::string, std::vector<double>>>>;
LoadsByTag wall_loads(SmallWorld& w, const WorldParts& parts) {
  LoadsByTag found;
  parts.bed.solid.store().for_each([&](const Resident& g) {
    parts.bed.solid.wall_loads().for_each_of(g.tag, [&](const WallLoad& load) {
      std::vector<double> numbers = {double(load.element)};
      numbers.insert(numbers.end(), load.force.data(), load.force.data() + 3);
      numbers.insert(numbers.end(), load.torque.data(), load.torque.data() + 3);
      const bool on_mesh = load.mesh != WallLoad::no_mesh;
      found[g.tag].emplace_back(on_mesh ? w.walls.mesh_names().at(static_cast<std::size_t>(load.mesh)) : "a plane", numbers);
    });
  });
  return found;
}

TEST(Snapshot, what_granules_press_on_walls_comes_back_where_these_are_as_they_were) {
  const auto with_meshes = [](int ranks, const std::vector<std::string>& names, double at = -0.5) {
    SmallDeck deck = ranks_along_x(ranks);
    for (const std::string& name : names) deck.meshes.push_back({name, {{Vec3(-1, -1, at), Vec3(1, -1, at), Vec3(0, 1, at)}}});
    return deck;
  };
  const std::vector<std::string> names = {"floor", "wall"};
  for (const int written_on : {1, 2}) {
    File file;
    LoadsByTag written;
    std::mutex mutex;
    run_on_ranks(with_meshes(written_on, names), [&](SmallWorld& w) {
      Block block(w, -0.03);
      std::vector<std::int64_t> stored;
      block.parts.bed.solid.store().for_each([&](const Resident& g) { stored.push_back(g.tag); });
      for (const std::int64_t tag : stored) {
        const int body = block.parts.bed.solid.store().find(tag)->body;
        std::vector<WallLoad> loads;
        for (int k = 0; k < tag % 4; ++k)  // none, of one mesh, of two, and of a plane
          loads.push_back({k == 2 ? WallLoad::no_mesh : k, int(tag) + k, Vec3(0.1 * tag, k, 1), Vec3(k, 0.2, tag)});
        block.parts.bed.solid.add_wall_loads(tag, body, loads);
      }
      const LoadsByTag here = wall_loads(w, block.parts);
      {
        const std::lock_guard<std::mutex> lock(mutex);
        written.insert(here.begin(), here.end());
      }
      file.write(w, block.parts);
    });
    ASSERT_GE(written.size(), 6u);
    const auto read_on = [&](const SmallDeck& deck, bool& same) {
      LoadsByTag read;
      run_on_ranks(deck, [&](SmallWorld& w) {
        WorldParts parts(w, sleeping_settings(), 2 * r);
        file.read(w, parts);
        const LoadsByTag here = wall_loads(w, parts);
        const std::lock_guard<std::mutex> lock(mutex);
        read.insert(here.begin(), here.end());
        same = parts.snapshot.walls_are_as_they_were();
      });
      return read;
    };
    for (const int ranks : {1, 2, 3}) {
      bool same = false;
      EXPECT_TRUE(read_on(with_meshes(ranks, names), same) == written) << written_on << " " << ranks;
      EXPECT_TRUE(same);
      EXPECT_TRUE(read_on(with_meshes(ranks, names, -0.51), same).empty()) << "a wall was moved";
      EXPECT_FALSE(same);
      EXPECT_TRUE(read_on(with_meshes(ranks, {"floor"}), same).empty()) << "a wall was taken away";
      EXPECT_FALSE(same);
    }
  }
}

TEST(Snapshot, the_users_faults_are_named) {
  File file;
  run_on_ranks(ranks_along_x(1), [&](SmallWorld& w) {
    Block block(w, -0.03);
    file.write(w, block.parts);
  });
  SmallWorld world(ranks_along_x(1));
  WorldParts parts(world, sleeping_settings(), 2 * r);
  parts.snapshot.read(file.state, file.end);
  world.contacts.width = 0;  // another contact model
  parts.bed.solid.set_histories(world.contacts.flips(), world.contacts.vectors());
  EXPECT_THROW(parts.snapshot.take_up(), InputError);
}

TEST(Snapshot, numbers_that_are_not_those_that_were_written_are_refused) {
  File file;
  run_on_ranks(ranks_along_x(1), [&](SmallWorld& w) {
    Block block(w, -0.03);
    file.write(w, block.parts);
  });
  const auto read = [&](const std::vector<double>& state) {
    std::vector<char> bytes(state.size() * sizeof(double) + 1);  // not aligned, as in the engine's buffer
    std::memcpy(&bytes[1], state.data(), bytes.size() - 1);
    return Snapshot::from_bytes(&bytes[1]);
  };
  EXPECT_EQ(read(file.state), file.state);
  EXPECT_EQ(Snapshot::interior_of(file.state), 10);
  // sizes that would have it read elsewhere: the one number alone, and both
  for (const double wrong : {-1.0, 0.0, 3.5, 1e300, std::nan(""), file.state[0] + 1, file.state[0] - 1}) {
    std::vector<double> state = file.state;
    state[0] = wrong;
    EXPECT_THROW(read(state), InputError) << wrong;
  }
  // any other number, in any way
  for (std::size_t k = 1; k < file.state.size(); ++k)
    for (const double wrong : {file.state[k] + 1, -1e9, std::nan("")}) {
      std::vector<double> state = file.state;
      state[k] = wrong;
      EXPECT_THROW(read(state), InputError) << k << " " << wrong;
    }
}

/// What reading the file ends with, by any number of ranks; empty if it is read.
std::string refusal(const File& file, int ranks) {
  std::string line;
  std::mutex mutex;
  run_on_ranks(ranks_along_x(ranks), [&](SmallWorld& w) {
    WorldParts parts(w, sleeping_settings(), 2 * r);
    try {
      file.read(w, parts);
    } catch (const InputError& e) {
      const std::lock_guard<std::mutex> lock(mutex);
      EXPECT_TRUE(line.empty() || line == e.what()) << "not alike on all ranks: " << line << "; " << e.what();
      line = e.what();
    }
  });
  return line;
}

TEST(Snapshot, a_section_that_is_cut_damaged_or_of_another_file_is_refused_by_all_ranks) {
  File file, other;
  for (File* f : {&file, &other})
    run_on_ranks(ranks_along_x(2), [&](SmallWorld& w) {
      Block block(w, f == &file ? -0.03 : -0.029);
      f->write(w, block.parts);
    });
  const std::string whole = bytes_of(file.end);
  const auto with = [&](const std::string& bytes, int ranks) {
    std::ofstream(file.end, std::ios::binary | std::ios::trunc) << bytes;
    return refusal(file, ranks);
  };
  const auto says = [](const std::string& line, const char* what) {
    return line.find(what) != std::string::npos && line.find('\n') == std::string::npos;
  };
  for (const int ranks : {1, 2, 3}) {
    EXPECT_EQ(with(whole, ranks), "");
    EXPECT_TRUE(says(with(bytes_of(other.end), ranks), "holds the granules of another restart file"));
    for (const std::size_t size : {std::size_t{0}, std::size_t{7}, whole.size() / 2, whole.size() - 1})
      EXPECT_TRUE(says(with(whole.substr(0, size), ranks), "ends before the granules of this fix do")) << size;
    EXPECT_TRUE(says(with(whole + "x", ranks), "ends before the granules of this fix do"));
    std::string begun = whole;  // a part is missing in the middle
    begun.erase(whole.size() / 2, 64);
    EXPECT_TRUE(says(with(begun, ranks), "is damaged"));
    std::remove(file.end.c_str());
    EXPECT_TRUE(says(refusal(file, ranks), "cannot be opened again"));
  }
  // any bit, wherever it is
  for (std::size_t at = 0; at < whole.size(); at += 1 + at % 37) {
    std::string broken = whole;
    broken[at] = static_cast<char>(broken[at] ^ (1 << at % 8));
    EXPECT_NE(with(broken, 2), "") << at;
  }
}

TEST(Snapshot, a_file_that_cannot_be_written_is_named) {
  run_on_ranks(ranks_along_x(2), [&](SmallWorld& w) {
    Block block(w, -0.03);
    block.parts.snapshot.write(false);
    EXPECT_THROW(block.parts.snapshot.append_to("/nowhere/at/all"), InputError);
  });
}

}  // namespace
}  // namespace solidcull
