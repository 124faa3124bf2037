// Seconds spent in the parts of the fix.
#pragma once

#include <array>
#include <chrono>

namespace solidcull {

enum class Part { load, look, depth, membership, shell, mesh, files, count };

class StopWatch {
 public:
  class Running {
   public:
    Running(StopWatch& watch, Part part) : watch_(watch), outer_(watch.part_) { watch_.switch_to(part); }
    ~Running() { watch_.switch_to(outer_); }
    Running(const Running&) = delete;

   private:
    StopWatch& watch_;
    Part outer_;
  };
  /// Time counts for this part until the returned object dies, then for the part before.
  Running time(Part part) { return Running(*this, part); }
  double seconds(Part part) const { return seconds_[static_cast<int>(part)]; }
  double total() const {
    double t = 0;
    for (const double s : seconds_) t += s;
    return t;
  }

 private:
  void switch_to(Part part) {
    const auto now = std::chrono::steady_clock::now();
    if (part_ != Part::count) seconds_[static_cast<int>(part_)] += std::chrono::duration<double>(now - since_).count();
    part_ = part;
    since_ = now;
  }

  std::array<double, static_cast<int>(Part::count)> seconds_{};
  Part part_ = Part::count;  // none
  std::chrono::steady_clock::time_point since_{};
};

}  // namespace solidcull
