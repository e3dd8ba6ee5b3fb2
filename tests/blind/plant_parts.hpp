/// @file
/// Small functions that every part of the plant uses.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace blind {

inline constexpr double kTwoPi = 2.0 * std::numbers::pi;

inline double sign_of(double x) {
  return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : 0.0;
}
inline double above(double x) {
  return x > 0.0 ? x : 0.0;
}

/// std::floor of what fits 63 bits, without a call.
inline double floor_of(double x) {
  const auto whole = static_cast<double>(static_cast<std::int64_t>(x));
  return whole > x ? whole - 1.0 : whole;
}

/// 1 − e^(−h/T), kept as long as h and T stay.
struct Lag {
  double time = 0.0, step = 0.0, share = 0.0;
  double of(double h, double T) {
    if (h != step || T != time) {
      step = h;
      time = T;
      share = 1.0 - std::exp(-h / T);
    }
    return share;
  }
};

/// Play: the follower stays within ±half of the leader.
inline double follow_play(double follower, double leader, double half) {
  return std::clamp(follower, leader - half, leader + half);
}

}  // namespace blind
