/// @file
/// The muscle pair with its memory: pressures, angle and speed to torque.
#pragma once

#include <cmath>
#include <cstdint>

#include "hidden.hpp"
#include "plant_parts.hpp"
#include "rig.hpp"

namespace blind {

/// The pair with its memory. `at` looks ahead within a step without moving the memory; `settle` moves it.
class Muscles {
 public:
  Muscles(const Rig& rig, const Hidden& h, double angle) : rig_(rig), h_(h), wheel_(angle), rest_(angle) {
    memory_ = h.hysteresis != 0 || h.asym_up != 0 || h.creep != 0 || h.maxwell != 0 || h.heat_friction != 0 ||
              h.play != 0;
    warming_ = h.warm_A != 0 || h.warm_B != 0;
    // Terms that are zero are not worked out: the sums stay the same to the last bit.
    bare_ = !memory_ && h.torque_offset == 0 && h.asymmetry == 0 && h.cubic_stiffness == 0 &&
            h.mean_stiffness == 0 && h.quadratic == 0 && h.slack_share == 0 && h.ripple == 0 &&
            h.mean_damping == 0 && h.cubic_pressure == 0 && h.periodic == 0 && h.lever == 0 &&
            h.odd_pressure_angle == 0 && h.root_damping == 0 && h.angle_damping == 0 && h.step_stiffness == 0;
    slippery_ = h.coulomb == 0 && h.stribeck_slide == 0 && h.stribeck_extra == 0 && h.loaded == 0 &&
                h.angle_friction == 0 && h.heat_friction == 0 && h.sticking == 0;
  }

  [[nodiscard]] bool memory() const { return memory_; }

  void clock(double day) {
    day_ = day;
    const double warm = warming_ ? 1.0 - std::exp(-day / h_.warm_time) : 0.0;
    A_ = rig_.A * (1.0 + h_.warm_A * warm) * (day >= h_.wear_time ? 1.0 - h_.wear : 1.0);
    B_ = rig_.B * (1.0 + h_.warm_B * warm);
    stiffness_ = A_ * rig_.r * rig_.r;
    if (h_.periodic != 0)
      swing_ = h_.periodic * std::sin(kTwoPi * h_.periodic_frequency * day_ + h_.periodic_phase);
    prepare();
    gripped_ = false;
    if (h_.sticking != 0) {
      const auto window = static_cast<std::uint64_t>(day / h_.sticking_window);
      if (window != window_) gripped_drawn_ = Random(h_.seed + window).uniform() < h_.sticking_share;
      window_ = window;
      gripped_ = gripped_drawn_;
    }
  }

  void pressures(double p1, double p2) {
    p1_ = p1;
    p2_ = p2;
    prepare();
    if (h_.loaded != 0) loaded_ = h_.loaded * std::pow(above(mean_) / rig_.p0, h_.loaded_power);
  }

  [[nodiscard]] double wheel(double angle) const {
    return h_.play != 0 ? follow_play(wheel_, angle, h_.play) : angle;
  }
  [[nodiscard]] double wheel_speed(double angle, double speed) const {
    if (h_.play == 0) return speed;
    const double gap = angle - wheel_;
    return std::abs(gap) >= h_.play * (1.0 - 1e-12) && gap * speed > 0.0 ? speed : 0.0;
  }

  [[nodiscard]] double pull() const {
    return rig_.pull_zero + rig_.pull_gain * 0.5 * (effective(p1_) + effective(p2_));
  }

  /// All but dry friction, at a joint angle and speed (N m).
  [[nodiscard]] double smooth(double angle, double speed) const {
    const double phi = wheel(angle), w = wheel_speed(angle, speed);
    const double C = rig_.C + h_.cubic_damping, D = rig_.D + h_.linear_damping;
    double T = stiffness_ * phi + push_ - C * w * w * w - D * w;
    if (bare_) return T;
    if (h_.lever != 0) {
      const double r = rig_.r * (1.0 + h_.lever * phi * phi);
      T = A_ * r * r * phi + B_ * r * delta_ - C * w * w * w - D * w;
    }
    T += h_.torque_offset + h_.asymmetry * rig_.r * mean_;
    if (h_.cubic_stiffness != 0) T -= h_.cubic_stiffness * phi * phi * phi;
    if (h_.mean_stiffness != 0)
      T += h_.mean_stiffness * rig_.A * rig_.r * rig_.r * phi * (mean_ / rig_.p0 - 1.0);
    if (h_.quadratic != 0) T += h_.quadratic * delta_ * rig_.r * rig_.r * rig_.r * phi * phi;
    if (h_.slack_share != 0)
      T -= h_.slack_share * rig_.A * rig_.r * rig_.r * above(std::abs(phi) - h_.slack_angle) * sign_of(phi);
    if (h_.ripple != 0) T += h_.ripple * std::sin(h_.ripple_teeth * phi + h_.ripple_phase);
    if (h_.mean_damping != 0) T -= h_.mean_damping * w * (mean_ - rig_.p0);
    if (h_.cubic_pressure != 0) T += h_.cubic_pressure * delta_ * delta_ * delta_;
    T += swing_;
    if (h_.odd_pressure_angle != 0) T += h_.odd_pressure_angle * rig_.r * delta_ * std::abs(phi) * phi;
    if (h_.root_damping != 0) T -= h_.root_damping * std::sqrt(std::abs(w)) * sign_of(w);
    if (h_.angle_damping != 0) T -= h_.angle_damping * w * phi * phi;
    if (h_.step_stiffness != 0)
      T -= h_.step_stiffness *
           (std::clamp(phi, h_.step_from, h_.step_to) - std::clamp(0.0, h_.step_from, h_.step_to));
    if (!memory_) return T;
    const double moved = phi - wheel_;
    if (h_.hysteresis != 0) T -= h_.hysteresis * dahl(moved);
    if (h_.asym_up != 0) T -= asymmetric(moved);
    T -= h_.creep * (phi - rest_);
    T -= spring_ + h_.maxwell * moved;
    return T;
  }

  /// Magnitude of the dry friction when sliding at this speed (N m).
  [[nodiscard]] double dry(double angle, double speed) const {
    if (slippery_) return 0.0;
    double f = h_.coulomb + h_.stribeck_slide;
    if (h_.stribeck_extra != 0) {
      const double ratio = speed / h_.stribeck_speed;
      f += h_.stribeck_extra * std::exp(-ratio * ratio);
    }
    f += loaded_;
    f += h_.angle_friction * std::abs(angle) + h_.heat_friction * heat_;
    return gripped_ ? f + h_.sticking : f;
  }

  /// The step is done: the joint stands at `angle`.
  void settle(double angle, double speed, double h) {
    if (!memory_) return;
    const double phi = wheel(angle), moved = phi - wheel_;
    if (h_.hysteresis != 0) bristle_ = dahl(moved);
    if (h_.asym_up != 0) force_ = asymmetric(moved);
    wheel_ = phi;
    if (h_.creep != 0) rest_ += creep_.of(h, h_.creep_time) * (phi - rest_);
    if (h_.maxwell != 0) spring_ = (spring_ + h_.maxwell * moved) * std::exp(-h / h_.maxwell_time);
    if (h_.heat_friction != 0) heat_ += warmth_.of(h, h_.heat_time) * (std::abs(speed) - heat_);
  }

 private:
  /// What holds as long as clock and pressures stay.
  void prepare() {
    double p2 = effective(p2_);
    if (h_.bent_gain != 0) p2 -= h_.bent_gain * above(p2 - h_.bent_pressure);
    delta_ = 0.5 * (p2 - effective(p1_));
    mean_ = 0.5 * (p1_ + p2_);
    push_ = B_ * rig_.r * delta_;
  }

  [[nodiscard]] double effective(double p) const { return h_.threshold != 0 ? above(p - h_.threshold) : p; }

  // dz/dφ = (1 − z s)/φ_s, s = sgn φ̇, has the solution z = s + (z0 − s) e^(−|Δφ|/φ_s).
  [[nodiscard]] double dahl(double moved) const {
    const double s = sign_of(moved);
    return s == 0.0 ? bristle_ : s + (bristle_ - s) * std::exp(-std::abs(moved) / h_.hysteresis_reach);
  }
  [[nodiscard]] double asymmetric(double moved) const {
    if (moved == 0.0) return force_;
    const double end = moved > 0.0 ? h_.asym_up : -h_.asym_down;
    const double reach = moved > 0.0 ? h_.asym_reach_up : h_.asym_reach_down;
    return end + (force_ - end) * std::exp(-std::abs(moved) / reach);
  }

  const Rig& rig_;
  const Hidden& h_;
  double p1_ = 0, p2_ = 0, A_ = 0, B_ = 0, day_ = 0;
  double wheel_, rest_, bristle_ = 0, force_ = 0, spring_ = 0, heat_ = 0;
  std::uint64_t window_ = ~std::uint64_t{0};
  double stiffness_ = 0, delta_ = 0, mean_ = 0, push_ = 0, swing_ = 0, loaded_ = 0;
  Lag creep_, warmth_;
  bool memory_ = false, warming_ = false, bare_ = false, slippery_ = false, gripped_ = false,
       gripped_drawn_ = false;
};

}  // namespace blind
