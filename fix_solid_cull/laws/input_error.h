// The user's fault: what is wrong, with which value, and what to do.
#pragma once

#include <stdexcept>
#include <string>

namespace solidcull {

class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace solidcull
