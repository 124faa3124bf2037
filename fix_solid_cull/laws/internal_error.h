// Our own fault: an invariant does not hold. The adapter ends the run with one line that names rank and step.
#pragma once

#include <stdexcept>
#include <string>

namespace solidcull {

class InternalError : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

}  // namespace solidcull
