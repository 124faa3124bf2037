// The files of one keyword: a file for each step, and beside them a list that says at which time each was written.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace solidcull {

/// The first '*' of the pattern stands for the step; without one there is one file, and no list. The list is in the form of
/// ParaView (.series): JSON with name and time of each file, a file a line. Local.
class FileSeries {
 public:
  explicit FileSeries(const std::string& pattern);

  bool numbered() const { return numbered_; }
  /// The file of a step: nine digits at least, so that names sort as steps do.
  std::string file(std::int64_t step) const;
  /// The pattern without the star, and without a '.', '_' or '-' before it; and ".series".
  std::string list() const;
  /// The time (s) of a step, with the time step that holds now: from the newest earlier file of the list on, or else from step 0.
  /// An engine's own time may begin anew with each restart file.
  double time_of(std::int64_t step, double dt) const;
  /// The file of this step is there, and of this time (s). The list is written anew, whole: what stood in it, less files that are
  /// not there, that are no files of this pattern, or of steps from this one on; and this one. Throws std::runtime_error as
  /// WholeFile does.
  void note(std::int64_t step, double time) const;

 private:
  struct Entry {
    std::string name;
    std::int64_t step;
    double time;
  };
  std::vector<Entry> earlier_than(std::int64_t step) const;
  std::int64_t step_of(const std::string& name) const;

  std::string folder_, before_, after_;  // of the star
  bool numbered_;
};

}  // namespace solidcull
