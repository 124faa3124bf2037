#include <gtest/gtest.h>

#include <random>

#include "ledger.h"

namespace solidcull {
namespace {

StoredGranule booked(std::int64_t tag, const Vec3& position, double mass) {
  StoredGranule g;
  g.tag = tag;
  g.position = position;
  g.mass = mass;
  g.radius = 1e-3;
  return g;
}

/// A store whose every move is booked.
struct Books {
  GranuleStore store{0.01};
  Ledger ledger;

  void put(const StoredGranule& g) {
    store.add(g, nullptr, 0);
    ledger.stored(g);
  }
  void take(std::int64_t tag) {
    std::vector<double> record;
    ledger.returned(store.take(tag, record));
  }
};

TEST(Ledger, begins_with_nothing) {
  const Books books;
  EXPECT_EQ(books.ledger.count_due(), 0);
  EXPECT_EQ(books.ledger.mass_error(books.store), 0.0);
  EXPECT_EQ(books.ledger.granules_locked(), 0);
  EXPECT_EQ(books.ledger.granules_restored(), 0);
  EXPECT_EQ(books.ledger.carves(), 0);
  EXPECT_EQ(books.ledger.energy_added(), 0.0);
}

TEST(Ledger, agrees_with_the_store_through_a_million_moves) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> at(-0.1, 0.1), mass(1e-8, 1e-5);
  Books books;
  std::vector<std::int64_t> there;
  std::int64_t next = 1;
  for (int n = 0; n < 1000000; ++n) {
    if (there.size() < 500 || (there.size() < 1500 && random() % 2)) {
      const double x = at(random), y = at(random), z = at(random);
      there.push_back(next);
      books.put(booked(next++, Vec3(x, y, z), mass(random)));
    } else {
      std::swap(there[random() % there.size()], there.back());
      books.take(there.back());
      there.pop_back();
    }
  }
  EXPECT_EQ(books.ledger.count_due(), static_cast<std::int64_t>(books.store.size()));
  EXPECT_LE(std::abs(books.ledger.mass_error(books.store)), 1e-14 * books.store.mass());
  EXPECT_NEAR(books.store.mass(), books.store.mass_recounted(), 1e-14 * books.store.mass());
  while (!there.empty()) {
    books.take(there.back());
    there.pop_back();
  }
  EXPECT_EQ(books.ledger.count_due(), 0);
  EXPECT_LE(std::abs(books.ledger.mass_error(books.store)), 1e-18);
}

TEST(Ledger, finds_a_granule_that_is_missing_from_the_store) {
  Books books;
  books.put(booked(1, Vec3(0.1, 0, 0), 2e-6));
  books.put(booked(2, Vec3(0, 0.2, 0), 3e-6));
  std::vector<double> record;
  books.store.take(2, record);
  EXPECT_DOUBLE_EQ(books.ledger.mass_error(books.store), -3e-6);
  EXPECT_DOUBLE_EQ(books.store.mass_recounted(), 2e-6);
  EXPECT_EQ(books.ledger.count_due() - static_cast<std::int64_t>(books.store.size()), 1);
}

TEST(Ledger, finds_a_granule_that_comes_back_changed) {
  Books books;
  const StoredGranule g = booked(1, Vec3(0.1, 0, 0), 2e-6);
  books.put(g);
  std::vector<double> record;
  StoredGranule back = books.store.take(1, record);
  back.mass *= 1.5;
  books.ledger.returned(back);
  EXPECT_DOUBLE_EQ(books.ledger.mass_error(books.store), 1e-6);
}

TEST(Ledger, does_not_mind_a_granule_that_changes_its_body_and_its_place) {
  Books books;
  books.put(booked(1, Vec3(0.1, 0, 0), 0.5));
  books.put(booked(2, Vec3(0, 0.2, 0), 0.25));
  books.store.move(1, 7, Vec3(5, 5, 5));
  EXPECT_EQ(books.ledger.mass_error(books.store), 0.0);
  books.take(1);
  EXPECT_EQ(books.ledger.mass_error(books.store), 0.0);
  EXPECT_EQ(books.ledger.count_due(), 1);
}

TEST(Ledger, counts_and_adds_energy) {
  Ledger ledger;
  for (int n = 0; n < 5; ++n) ledger.locked();
  ledger.restored(0.0);
  ledger.restored(1e-9);
  ledger.restored(1.0);
  for (int n = 0; n < 3; ++n) ledger.carved();
  EXPECT_EQ(ledger.granules_locked(), 5);
  EXPECT_EQ(ledger.granules_restored(), 3);
  EXPECT_EQ(ledger.carves(), 3);
  EXPECT_DOUBLE_EQ(ledger.energy_added(), 1.0 + 1e-9);
}

TEST(Ledger, counters_go_through_a_restart_file) {
  Ledger ledger, again;
  for (int n = 0; n < 7; ++n) ledger.locked();
  ledger.restored(0.25);
  ledger.carved();
  again.restored(99);  // what was counted before is replaced
  again.set_counters(ledger.counters());
  EXPECT_EQ(again.granules_locked(), 7);
  EXPECT_EQ(again.granules_restored(), 1);
  EXPECT_EQ(again.carves(), 1);
  EXPECT_EQ(again.energy_added(), 0.25);
  again.locked();
  EXPECT_EQ(again.granules_locked(), 8);
}

}  // namespace
}  // namespace solidcull
