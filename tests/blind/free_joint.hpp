/// @file
/// A joint that moves under its muscles, with dry friction of true sign.
#pragma once

#include <algorithm>
#include <cmath>

#include "hidden.hpp"
#include "muscles.hpp"
#include "plant_parts.hpp"
#include "rig.hpp"

namespace blind {

/// I φ̈ = torque of the muscles and what else acts on the joint.
class Joint {
 public:
  Joint(const Rig& rig, const Hidden& h, const Muscles& muscles, double angle)
      : h_(h), muscles_(muscles), angle_(angle), far_angle_(angle) {
    inertia_ = rig.inertia + h.added_inertia;
    alone_ = h.quadratic_damping == 0 && h.gravity == 0 && h.stop_stiffness == 0 && h.compliance == 0;
    if (h.compliance != 0) {
      far_inertia_ = inertia_ * h.second_share;
      inertia_ -= far_inertia_;
      stiffness_ = 1.0 / h.compliance;
      const double reduced = inertia_ * far_inertia_ / (inertia_ + far_inertia_);
      damping_ = 2.0 * h.second_damping * std::sqrt(stiffness_ * reduced);
    }
  }

  [[nodiscard]] double angle() const { return angle_; }
  [[nodiscard]] double speed() const { return speed_; }

  /// What the muscles give now, dry friction with it: when it sticks, that which holds.
  [[nodiscard]] double muscle_torque() const {
    const double smooth = muscles_.smooth(angle_, speed_), held = muscles_.dry(angle_, speed_);
    if (speed_ != 0.0) return smooth - held * sign_of(muscles_.wheel_speed(angle_, speed_));
    const double all = smooth + others(angle_, 0.0, far_angle_, far_speed_), limit = held + h_.bearing;
    if (limit == 0.0) return smooth;
    return smooth - held / limit * std::clamp(all, -limit, limit);
  }

  void advance(double h) {
    // At most a few events in a step; each goes on with what is left of it.
    for (int events = 0; h > 0.0 && events < 4; ++events) {
      double direction = sign_of(speed_);
      const double dry_now = muscles_.dry(angle_, 0.0) + h_.bearing;
      if (direction == 0.0) {
        const double drive = muscles_.smooth(angle_, 0.0) + others(angle_, 0.0, far_angle_, far_speed_);
        if (std::abs(drive) <= dry_now) {
          if (h_.compliance == 0) return;  // it sticks
          far_step(h);
          return;
        }
        direction = sign_of(drive);
      }
      const State before{angle_, speed_, far_angle_, far_speed_};
      const State after = runge_kutta(before, h, direction);
      if (dry_now == 0.0 || after.w * direction >= 0.0) {
        set(after);
        return;
      }
      // It stops within the step: go to that moment, at rest, and look again.
      const double share = before.w / (before.w - after.w);
      State stopped = runge_kutta(before, share * h, direction);
      stopped.w = 0.0;
      set(stopped);
      h *= 1.0 - share;
      if (share == 0.0) return;
    }
  }

 private:
  struct State {
    double phi, w, far_phi, far_w;
  };

  [[nodiscard]] double others(double phi, double w, double far_phi, double far_w) const {
    if (alone_) return 0.0;
    double T = -h_.quadratic_damping * w * std::abs(w);
    if (h_.gravity != 0) T -= h_.gravity * std::sin(phi + h_.gravity_angle);
    if (h_.stop_stiffness != 0) {
      if (h_.stop_side >= 0) T -= h_.stop_stiffness * above(phi - h_.stop_angle);
      if (h_.stop_side <= 0) T += h_.stop_stiffness * above(-phi - h_.stop_angle);
    }
    if (h_.compliance != 0) T -= stiffness_ * (phi - far_phi) + damping_ * (w - far_w);
    return T;
  }

  /// φ̈ of the wheel, with dry friction against `direction`.
  [[nodiscard]] double acceleration(const State& s, double direction) const {
    const double T = muscles_.smooth(s.phi, s.w) + others(s.phi, s.w, s.far_phi, s.far_w);
    return (T - direction * (muscles_.dry(s.phi, s.w) + h_.bearing)) / inertia_;
  }

  [[nodiscard]] State runge_kutta(const State& s, double h, double direction) const {
    return h_.compliance != 0 ? runge_kutta_of<true>(s, h, direction)
                              : runge_kutta_of<false>(s, h, direction);
  }

  /// The far side of a spring is carried along only where there is one: most of the time goes into this.
  template <bool kSpring>
  [[nodiscard]] State runge_kutta_of(const State& s, double h, double direction) const {
    const auto slope = [&](const State& at) {
      State d{at.w, acceleration(at, direction), 0.0, 0.0};
      if constexpr (kSpring) {
        d.far_phi = at.far_w;
        d.far_w = (stiffness_ * (at.phi - at.far_phi) + damping_ * (at.w - at.far_w)) / far_inertia_;
      }
      return d;
    };
    const auto moved = [&](const State& d, double step) {
      State to{s.phi + step * d.phi, s.w + step * d.w, s.far_phi, s.far_w};
      if constexpr (kSpring) {
        to.far_phi += step * d.far_phi;
        to.far_w += step * d.far_w;
      }
      return to;
    };
    const State a = slope(s), b = slope(moved(a, 0.5 * h)), c = slope(moved(b, 0.5 * h)),
                d = slope(moved(c, h));
    const auto mean = [](double k1, double k2, double k3, double k4) {
      return (k1 + 2.0 * (k2 + k3) + k4) / 6.0;
    };
    State all{mean(a.phi, b.phi, c.phi, d.phi), mean(a.w, b.w, c.w, d.w), 0.0, 0.0};
    if constexpr (kSpring) {
      all.far_phi = mean(a.far_phi, b.far_phi, c.far_phi, d.far_phi);
      all.far_w = mean(a.far_w, b.far_w, c.far_w, d.far_w);
    }
    return moved(all, h);
  }

  /// The wheel sticks; what hangs on the spring swings on (semi-implicit, it is exact enough for a moment of sticking).
  void far_step(double h) {
    far_speed_ += h * (stiffness_ * (angle_ - far_angle_) - damping_ * far_speed_) / far_inertia_;
    far_angle_ += h * far_speed_;
  }

  void set(const State& s) {
    angle_ = s.phi;
    speed_ = s.w;
    far_angle_ = s.far_phi;
    far_speed_ = s.far_w;
  }

  const Hidden& h_;
  const Muscles& muscles_;
  bool alone_ = true;  ///< nothing but muscles and bearing acts on the joint
  double inertia_ = 1, far_inertia_ = 0, stiffness_ = 0, damping_ = 0;
  double angle_, speed_ = 0, far_angle_, far_speed_ = 0;
};

}  // namespace blind
