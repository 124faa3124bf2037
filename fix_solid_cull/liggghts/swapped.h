// A variable that has another value for a scope.
#pragma once

namespace solidcull {

template <class T>
class Swapped {
 public:
  Swapped(T& variable, T value) : variable_(variable), old_(variable) { variable = value; }
  ~Swapped() { variable_ = old_; }
  Swapped(const Swapped&) = delete;

 private:
  T& variable_;
  T old_;
};

}  // namespace solidcull
