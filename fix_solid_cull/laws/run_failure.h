// The run has come apart: a motion or force that is no number any more, or more than a rank can hold. The deck's doing, and seen
// by one rank alone. The adapter ends the run with one line that names the step.
#pragma once

#include <stdexcept>
#include <string>

namespace solidcull {

class RunFailure : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace solidcull
