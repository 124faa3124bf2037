// A sum whose rounding does not grow with the number of terms (Neumaier's compensated summation).
#pragma once

#include <cmath>

namespace solidcull {

class ExactSum {
 public:
  ExactSum& operator+=(double x) {
    const double t = sum_ + x;
    lost_ += std::abs(sum_) >= std::abs(x) ? (sum_ - t) + x : (x - t) + sum_;
    sum_ = t;
    return *this;
  }
  ExactSum& operator-=(double x) { return *this += -x; }
  double value() const { return sum_ + lost_; }

 private:
  double sum_ = 0, lost_ = 0;
};

}  // namespace solidcull
