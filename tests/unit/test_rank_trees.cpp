#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "rank_trees.h"

namespace solidcull {
namespace {

/// Ranks that send each other messages and agree, and nothing else: as many as one likes, a thread each.
class Crowd {
 public:
  Crowd(int count, int hops) : hops_(hops), boxes_(static_cast<std::size_t>(count)) {}

  class Member : public Ranks {
   public:
    Member(Crowd& crowd, int rank) : crowd_(crowd) {
      me = rank;
      count = static_cast<int>(crowd.boxes_.size());
    }
    bool any(bool here) const override { return crowd_.agree(here); }
    void send(int rank, const void* bytes, std::size_t n) const override {
      const char* const first = static_cast<const char*>(bytes);
      Box& box = crowd_.boxes_[static_cast<std::size_t>(rank)];
      const std::lock_guard<std::mutex> lock(box.mutex);
      box.from[me].emplace_back(first, first + n);
      box.came.notify_all();
    }
    std::vector<char> receive(int rank) const override {
      Box& box = crowd_.boxes_[static_cast<std::size_t>(me)];
      std::unique_lock<std::mutex> lock(box.mutex);
      std::deque<std::vector<char>>& queue = box.from[rank];
      if (!box.came.wait_for(lock, std::chrono::seconds(60), [&] { return !queue.empty(); }))
        throw InternalError("no message came");
      std::vector<char> bytes = std::move(queue.front());
      queue.pop_front();
      bytes_received += bytes.size();
      senders.insert({rank, 0});
      return bytes;
    }
    int hops() const override { return crowd_.hops_; }
    mutable std::size_t bytes_received = 0;
    mutable std::map<int, int> senders;

    // what trees do not ask for
    void sum(double*, int) const override { throw InternalError("sum"); }
    void sum(std::int64_t*, int) const override { throw InternalError("sum"); }
    std::int64_t sum_before(std::int64_t) const override { throw InternalError("sum_before"); }
    std::unique_ptr<SharedFile> open_to_write(const std::string&) const override { throw InternalError("open_to_write"); }
    void largest(double*, int) const override { throw InternalError("largest"); }
    void largest(std::int64_t*, int) const override { throw InternalError("largest"); }
    void begin_any(unsigned) const override {}
    unsigned end_any() const override { return 0; }
    bool has_neighbours() const override { return true; }
    void update() override {}
    bool subdomains_changed() const override { return false; }
    int owner(const Vec3&) const override { return me; }
    Box own() const override { return {}; }
    std::array<std::vector<double>, 3> cuts() const override { return {}; }
    double thinnest() const override { return 0; }
    void move_cuts(const std::array<std::vector<double>, 3>&) override {}
    bool is_far_out(const Vec3&) const override { return false; }
    bool brings_home(const Vec3&) const override { return true; }
    void expect_far_out(bool) override {}
    std::vector<int> neighbours(double) const override { return {}; }
    const std::vector<Vec3>& image_shifts() const override {
      static const std::vector<Vec3> none{Vec3::Zero()};
      return none;
    }

   protected:
    void exchange_bytes(const void*, std::size_t, std::size_t, double, const Room&) const override {
      throw InternalError("exchange");
    }
    void deliver_bytes(const std::vector<Letter>&, std::size_t, const RoomFrom&) const override {
      throw InternalError("deliver");
    }
    void gather_bytes(const void*, std::size_t, std::size_t, bool, const Room&) const override { throw InternalError("gather"); }

   private:
    Crowd& crowd_;
  };

  void run(const std::function<void(Member&)>& work) {
    std::vector<std::thread> threads;
    std::atomic<int> failed{0};
    for (int rank = 0; rank < static_cast<int>(boxes_.size()); ++rank)
      threads.emplace_back([&, rank] {
        Member member(*this, rank);
        try {
          work(member);
        } catch (const std::exception& e) {
          ++failed;
          ADD_FAILURE() << "rank " << rank << ": " << e.what();
        }
      });
    for (std::thread& t : threads) t.join();
    ASSERT_EQ(failed, 0);
  }
  int agreements = 0;

 private:
  struct Box {
    std::mutex mutex;
    std::condition_variable came;
    std::map<int, std::deque<std::vector<char>>> from;
  };
  bool agree(bool here) {
    std::unique_lock<std::mutex> lock(mutex_);
    any_ = any_ || here;
    const int round = agreements;
    if (++met_ == boxes_.size()) {
      met_ = 0;
      agreed_ = any_;
      any_ = false;
      ++agreements;
      all_met_.notify_all();
    } else if (!all_met_.wait_for(lock, std::chrono::seconds(60), [&] { return agreements != round; })) {
      throw InternalError("ranks did not meet");
    }
    return agreed_;
  }

  const int hops_;
  std::vector<Box> boxes_;
  std::mutex mutex_;
  std::condition_variable all_met_;
  std::size_t met_ = 0;
  bool any_ = false, agreed_ = false;
};

using Links = std::map<int, std::vector<PartLink>>;

TEST(RankTrees, a_body_that_winds_through_many_ranks_is_one_however_long_it_is) {
  constexpr int ranks = 40;
  Crowd crowd(ranks, 3);  // far fewer rounds than there are links
  std::atomic<std::int64_t> keys{0};
  crowd.run([&](Crowd::Member& me) {
    RankTrees trees(me);
    Links links;  // part 1 of each rank, in a row; rank 20 comes first
    const int at = (me.me + 20) % ranks;
    for (const int next : {at - 1, at + 1})
      if (next >= 0 && next < ranks) links[1].push_back({(next + 20) % ranks, 1, Vec3::Zero(), {}});
    trees.grow(links, Vec3::Zero());
    ASSERT_EQ(trees.parts().size(), 1u);
    keys += trees.parts()[0].key;
    EXPECT_EQ(trees.place_of(1), 0);
    EXPECT_EQ(trees.place_of(2), -1);
    std::vector<std::int64_t> sums{me.me};
    trees.unite(sums, [](std::int64_t& whole, std::int64_t other) { whole += other; });
    EXPECT_EQ(sums[0], ranks * (ranks - 1) / 2);
  });
  EXPECT_EQ(keys, ranks * ranks);  // all have that of rank 0, which is 1 * ranks + 0
}

TEST(RankTrees, bodies_that_cross_each_other_keep_their_sums_apart_and_nobody_waits_for_ever) {
  constexpr int ranks = 6;
  for (int round = 0; round < 20; ++round) {
    Crowd crowd(ranks, 1);
    crowd.run([&](Crowd::Member& me) {
      RankTrees trees(me);
      // body b of rank r is tied to the same one of rank r + b, round and round: bodies 1 and 2 are rings or several of them
      Links links;
      for (const int b : {1, 2, 3, 4})
        for (const int step : {-b, b}) {
          const int other = (me.me + step + ranks) % ranks;
          std::vector<PartLink>& of = links[b];
          const bool known = std::any_of(of.begin(), of.end(), [&](const PartLink& l) { return l.rank == other; });
          if (other != me.me && !known) of.push_back({other, b, Vec3::Zero(), {}});
        }
      trees.grow(links, Vec3::Zero());
      struct Row {
        int body, ranks, first;
      };
      std::vector<Row> rows;
      for (const RankTrees::Part& p : trees.parts()) rows.push_back({p.body, 1, me.me});
      for (int again = 0; again < 3; ++again) {
        std::vector<Row> whole = rows;
        trees.unite(
            whole,
            [](Row& all, const Row& other) {
              EXPECT_EQ(all.body, other.body);
              all.ranks += other.ranks;
              all.first = std::min(all.first, other.first);
            },
            [&](int place) { return again < 2 || rows[static_cast<std::size_t>(place)].body != 2; });
        for (const Row& r : whole) {
          const int circles = r.body == 1 ? 1 : r.body == 3 ? 3 : 2;
          if (again == 2 && r.body == 2) {
            EXPECT_EQ(r.ranks, 1);
            continue;
          }
          EXPECT_EQ(r.ranks, ranks / circles) << r.body;
          EXPECT_EQ(r.first, me.me % circles) << r.body;
        }
      }
    });
  }
}

TEST(RankTrees, a_ring_through_a_periodic_side_is_seen_to_be_tied_to_its_image) {
  const Vec3 periods(1, 0, 0);
  for (const bool closed : {true, false}) {
    Crowd crowd(3, 2);
    crowd.run([&](Crowd::Member& me) {
      RankTrees trees(me);
      Links links;
      if (me.me < 2) links[5].push_back({me.me + 1, 5, Vec3::Zero(), {}});
      if (me.me > 0) links[5].push_back({me.me - 1, 5, Vec3::Zero(), {}});
      if (closed && me.me == 2) links[5].push_back({0, 5, Vec3(-1, 0, 0), {}});
      if (closed && me.me == 0) links[5].push_back({2, 5, Vec3(1, 0, 0), {}});
      trees.grow(links, periods);
      std::vector<int> tied{trees.parts()[0].tied[0]};
      trees.unite(tied, [](int& whole, int other) { whole |= other; });
      EXPECT_EQ(tied[0], closed);
    });
  }
}

/// A bed over a cube of ranks, each with one part that touches those of all ranks around it, at corners too.
std::size_t bytes_of_the_innermost(int edge) {
  Crowd crowd(edge * edge * edge, 3 * (edge - 1));
  std::size_t bytes = 0;
  crowd.run([&](Crowd::Member& me) {
    const std::array<int, 3> at{me.me % edge, me.me / edge % edge, me.me / edge / edge};
    Links links;
    for (int n = 0; n < 27; ++n) {
      const std::array<int, 3> next{at[0] + n % 3 - 1, at[1] + n / 3 % 3 - 1, at[2] + n / 9 - 1};
      const bool inside = std::all_of(next.begin(), next.end(), [&](int c) { return c >= 0 && c < edge; });
      if (inside && next != at) links[1].push_back({next[0] + edge * (next[1] + edge * next[2]), 1, Vec3::Zero(), {}});
    }
    RankTrees trees(me);
    trees.grow(links, Vec3::Zero());
    const std::size_t grown = me.bytes_received;
    std::vector<double> sum{1.0};
    trees.unite(sum, [](double& whole, double other) { whole += other; });
    EXPECT_EQ(sum[0], edge * edge * edge);
    EXPECT_LE(me.senders.size(), 26u);
    EXPECT_LE(me.bytes_received - grown, 27 * 16u);
    const int middle = edge / 2;
    if (at == std::array<int, 3>{middle, middle, middle}) bytes = grown / static_cast<std::size_t>(me.hops() + 2);
  });
  EXPECT_EQ(crowd.agreements, 1);
  return bytes;
}

TEST(RankTrees, a_rank_of_a_thousand_hears_no_more_than_one_of_sixty_four) {
  EXPECT_EQ(bytes_of_the_innermost(10), bytes_of_the_innermost(4));
}

}  // namespace
}  // namespace solidcull
