// Where tests write the section of a restart file.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdio>
#include <mutex>
#include <string>
#include <vector>

namespace solidcull {

/// The culling's part of a restart file, gone with the test. Ranks write it one after the other, under `mutex`.
struct SectionFile {
  std::mutex mutex;
  std::vector<double> state;  // in the engine's head
  std::string end = ::testing::TempDir() + "solidcull-section-" + std::to_string(reinterpret_cast<std::uintptr_t>(this));

  SectionFile() { std::remove(end.c_str()); }
  ~SectionFile() { std::remove(end.c_str()); }
  SectionFile(const SectionFile&) = delete;
};

}  // namespace solidcull
