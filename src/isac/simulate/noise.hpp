/// @file
/// Sensor noise as amplifiers make it: a white part, a slow part with one pole, and a hum from the mains.
///
///   n(t) = σ_w w + c(t) + h sin(2π f t + ψ),   c(t + dt) = a c(t) + σ_c sqrt(1 − a²) w,   a = e^(−dt/τ)
///
/// The slow part is an Ornstein-Uhlenbeck process sampled exactly, so unequal steps are right too; sampled evenly it is AR(1)
/// with pole a and variance σ_c². Units: those of the signal; seconds, hertz.
/// Real time: no heap, no lock, noexcept. Errors: none. Source: docs/derivations/simulated_rig.md, "Sensors".
#pragma once

#include <cmath>
#include <cstdint>

#include "isac/core/units.hpp"
#include "isac/simulate/random.hpp"

namespace isac::simulate {

struct NoiseLevel {
  double white = 0;          ///< σ_w
  double coloured = 0;       ///< σ_c
  double time_constant = 1;  ///< τ in s
  double hum = 0;            ///< h, amplitude
  double hum_hz = 60;        ///< f
};

class SensorNoise {
 public:
  SensorNoise(const NoiseLevel& level, std::uint64_t seed, std::uint64_t stream) noexcept
      : level_(level), random_(seed, stream) {
    phase_ = random_.uniform(0, 2 * kPi);
    slow_ = level_.coloured * random_.normal();
  }

  /// The noise of the sample taken at time t; times do not go backwards.
  double sample(double t) noexcept {
    const double a = std::exp(-(t - last_) / level_.time_constant);
    slow_ = a * slow_ + level_.coloured * std::sqrt(1 - a * a) * random_.normal();
    last_ = t;
    return level_.white * random_.normal() + slow_ +
           level_.hum * std::sin(2 * kPi * level_.hum_hz * t + phase_);
  }

 private:
  NoiseLevel level_;
  Random random_;
  double phase_ = 0, slow_ = 0, last_ = 0;
};

}  // namespace isac::simulate
