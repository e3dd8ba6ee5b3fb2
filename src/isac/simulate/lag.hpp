/// @file
/// A first-order lag τ ẏ + y = u, solved exactly for an input that runs in a straight line between the times it is given.
///
///   y(h) = u1 − m τ + (y0 − u0 + m τ) e^(−h/τ),   m = (u1 − u0)/h
///
/// The amplifier's lag (0.16 ms) would make the rig's differential equations stiff; here it costs one exponential.
/// Units: seconds and whatever u has. τ = 0 passes u through. Real time: no heap, no lock, noexcept. Errors: none.
/// Source: docs/derivations/simulated_rig.md, "Sensors".
#pragma once

#include <cmath>

namespace isac::simulate {

class FirstOrderLag {
 public:
  explicit FirstOrderLag(double time_constant = 0) noexcept : tau_(time_constant) {}

  /// The lag has rested at u.
  void reset(double t, double u) noexcept {
    t_ = t;
    u_ = u;
    y_ = u;
  }

  /// y at time t, the input having moved in a straight line to u since the last call. A time not later changes nothing.
  double update(double t, double u) noexcept {
    const double h = t - t_;
    if (h <= 0) return y_;
    if (tau_ > 0) {
      const double m_tau = (u - u_) / h * tau_;
      y_ = u - m_tau + (y_ - u_ + m_tau) * std::exp(-h / tau_);
    } else {
      y_ = u;
    }
    t_ = t;
    u_ = u;
    return y_;
  }

 private:
  double tau_;
  double t_ = 0, u_ = 0, y_ = 0;
};

}  // namespace isac::simulate
