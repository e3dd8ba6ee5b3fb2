/// @file
/// Random numbers that are the same on every platform: only the bits of std::mt19937_64 (fixed by the standard), no
/// std::*_distribution (whose results are not).
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

namespace blind {

class Random {
 public:
  explicit Random(std::uint64_t seed) : bits_(seed) {}

  /// Uniform in (0, 1), 53 bits.
  double uniform() { return (static_cast<double>(bits_() >> 11) + 0.5) * 0x1p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Uniform in the logarithm, 0 < low < high.
  double log_uniform(double low, double high) { return low * std::exp(uniform() * std::log(high / low)); }
  double sign() { return (bits_() >> 63) != 0 ? 1.0 : -1.0; }
  int index(int count) { return static_cast<int>(uniform() * count); }
  /// Standard normal by Box and Muller, the second number kept for the next call.
  double normal() {
    if (kept_) {
      kept_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2.0 * std::log(uniform()));
    const double turn = 2.0 * std::numbers::pi * uniform();
    spare_ = radius * std::sin(turn);
    kept_ = true;
    return radius * std::cos(turn);
  }
  /// A stream of its own, so that what one part draws does not shift what another part draws.
  Random fork() { return Random(bits_() ^ 0x9e3779b97f4a7c15ull); }

 private:
  std::mt19937_64 bits_;
  double spare_ = 0.0;
  bool kept_ = false;
};

}  // namespace blind
