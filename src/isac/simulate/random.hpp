/// @file
/// Pseudo-random numbers that are the same on every machine: xoshiro256++ (Blackman, Vigna), seeded by splitmix64.
///
/// The distributions of the C++ library may differ between libraries; these may not, because a seed that is printed must
/// give the same rig back. Each user of randomness (noise, jitter, hand …) has a stream of its own, so that switching one
/// off leaves the others as they were.
/// Real time: no heap, no lock, noexcept. Threads: one thread per object. Errors: none.
/// Source: docs/derivations/simulated_rig.md. Example: `Random random(seed, Random::kHand); random.uniform(8, 12);`
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

namespace isac::simulate {

class Random {
 public:
  enum Stream : std::uint64_t {
    kForce1 = 1,
    kForce2,
    kPressure1,
    kPressure2,
    kTiming,
    kHand,
    kCalibration,
    kSpikes
  };

  Random(std::uint64_t seed, std::uint64_t stream) noexcept {
    std::uint64_t x = seed ^ (stream * 0xD1342543DE82EF95u);
    for (auto& word : state_) {  // splitmix64
      x += 0x9E3779B97F4A7C15u;
      std::uint64_t z = x;
      z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
      z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
      word = z ^ (z >> 31);
    }
  }

  [[nodiscard]] std::uint64_t next() noexcept {
    const std::uint64_t result = rotate(state_[0] + state_[3], 23) + state_[0];
    const std::uint64_t t = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= t;
    state_[3] = rotate(state_[3], 45);
    return result;
  }

  /// In [0, 1).
  [[nodiscard]] double uniform() noexcept { return static_cast<double>(next() >> 11) * 0x1.0p-53; }
  [[nodiscard]] double uniform(double low, double high) noexcept { return low + (high - low) * uniform(); }

  /// Mean 0, variance 1 (Marsaglia's polar method).
  [[nodiscard]] double normal() noexcept {
    if (has_spare_) {
      has_spare_ = false;
      return spare_;
    }
    double u = 0, v = 0, s = 0;
    do {
      u = uniform(-1, 1);
      v = uniform(-1, 1);
      s = u * u + v * v;
    } while (s >= 1 || s == 0);
    const double scale = std::sqrt(-2 * std::log(s) / s);
    spare_ = v * scale;
    has_spare_ = true;
    return u * scale;
  }

  [[nodiscard]] double exponential(double mean) noexcept { return -mean * std::log1p(-uniform()); }

 private:
  static std::uint64_t rotate(std::uint64_t x, int k) noexcept { return (x << k) | (x >> (64 - k)); }

  std::array<std::uint64_t, 4> state_{};
  double spare_ = 0;
  bool has_spare_ = false;
};

}  // namespace isac::simulate
