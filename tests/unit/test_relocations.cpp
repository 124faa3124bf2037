// Whether a library's calls can be redirected, and where they lead: read from two libraries that call themselves.
#include <gtest/gtest.h>

#include <algorithm>

#include "relocations.h"

extern "C" {
int open_answer();  // this program's, for the program comes first in the search for symbols
int open_caller();
int closed_answer();
int closed_caller();
int lone_answer();
int lone_caller();
}
extern "C" int open_answer() { return 2; }
extern "C" int closed_answer() { return 2; }

namespace {

using solidcull::call_targets;

const void* address(int (*function)()) { return reinterpret_cast<const void*>(function); }

TEST(Relocations, show_that_calls_lead_to_whoever_comes_first) {
  ASSERT_EQ(open_caller(), 2);  // and bind the call
  const auto targets = call_targets(address(open_caller), "open_answer");
  ASSERT_EQ(targets.size(), 2U);  // the call, and the table
  for (const void* target : targets) EXPECT_EQ(target, address(open_answer));
}

TEST(Relocations, show_that_calls_lead_to_the_library_itself_where_nobody_comes_before) {
  ASSERT_EQ(lone_caller(), 1);
  const auto targets = call_targets(address(lone_caller), "lone_answer");
  EXPECT_EQ(targets.size(), 2U);
  EXPECT_EQ(std::count(targets.begin(), targets.end(), address(lone_answer)), 2);
}

TEST(Relocations, are_absent_where_the_linker_has_bound_the_calls) {
  ASSERT_EQ(closed_caller(), 1);  // the library does not see this program's
  EXPECT_TRUE(call_targets(address(closed_caller), "closed_answer").empty());
}

TEST(Relocations, of_another_name_or_outside_every_library_are_none) {
  EXPECT_TRUE(call_targets(address(open_caller), "no_such_function").empty());
  EXPECT_TRUE(call_targets(nullptr, "open_answer").empty());
}

}  // namespace
