/// @file
/// The colour of a channel's noise: a white part and one Ornstein-Uhlenbeck process.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace blind {

inline constexpr std::size_t kBlock = 5;  ///< rows in a mean of 100 Hz

/// Variances of a channel's samples: a white part and one with memory.
struct Colour {
  double white = 0, slow = 0, stay = 0;

  void add(double variance, double memory, double sample_time) {
    if (variance <= 0.0) return;
    // Two slow parts become one with the memory of the larger.
    if (variance > slow) stay = std::exp(-sample_time / memory);
    slow += variance;
  }

  /// x becomes the innovations of its Kalman filter, of variance one.
  void whiten(std::vector<double>& x, std::size_t from) const {
    double estimate = 0.0, variance = slow;
    for (std::size_t k = from; k < x.size(); ++k) {
      const double innovation = x[k] - estimate, spread = variance + white, gain = variance / spread;
      x[k] = innovation / std::sqrt(spread);
      estimate = stay * (estimate + gain * innovation);
      variance = stay * stay * variance * (1.0 - gain) + slow * (1.0 - stay * stay);
    }
  }
};

/// White and slow part of a recorded noise of sd one, in means of kBlock rows.
Colour colour_of(const std::vector<double>& recorded);

}  // namespace blind
