/// @file
/// Small functions that every part of the plant uses.
#pragma once

#include <algorithm>
#include <numbers>

namespace blind {

inline constexpr double kTwoPi = 2.0 * std::numbers::pi;

inline double sign_of(double x) {
  return x > 0.0 ? 1.0 : x < 0.0 ? -1.0 : 0.0;
}
inline double above(double x) {
  return x > 0.0 ? x : 0.0;
}

/// Play: the follower stays within ±half of the leader.
inline double follow_play(double follower, double leader, double half) {
  return std::clamp(follower, leader - half, leader + half);
}

}  // namespace blind
