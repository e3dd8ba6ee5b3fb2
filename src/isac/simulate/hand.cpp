#include "isac/simulate/hand.hpp"

#include <algorithm>
#include <cmath>

#include "isac/core/units.hpp"

namespace isac::simulate {

namespace {

constexpr double kPeakOfStroke = 1.875;   // peak speed of a minimum-jerk stroke over its mean speed
constexpr double kLeadInSpeed = 1.0;      // rad/s, a person leads a bar gently
constexpr double kShortestLeadIn = 0.8;   // s
constexpr double kShortestStroke = 0.12;  // s, no arm is faster
constexpr double kGoldenRatio = 0.6180339887498949;

}  // namespace

Quintic::Quintic(const Motion& from, double target, double duration) noexcept : duration_(duration) {
  // Residual polynomial c3 s³ + c4 s⁴ + c5 s⁵ takes value d, slope dv, curvature da at s = T.
  const double T = duration;
  const double d = target - from.angle - from.velocity * T - 0.5 * from.acceleration * T * T;
  const double dv = -from.velocity - from.acceleration * T;
  const double da = -from.acceleration;
  c_ = {from.angle,
        from.velocity,
        0.5 * from.acceleration,
        (10 * d - 4 * dv * T + 0.5 * da * T * T) / (T * T * T),
        (-15 * d + 7 * dv * T - da * T * T) / (T * T * T * T),
        (6 * d - 3 * dv * T + 0.5 * da * T * T) / (T * T * T * T * T)};
}

Motion Quintic::at(double s) const noexcept {
  s = std::clamp(s, 0.0, duration_);
  Motion m{.angle = c_[5], .velocity = 5 * c_[5], .acceleration = 20 * c_[5]};
  for (int k = 4; k >= 0; --k) m.angle = m.angle * s + c_[static_cast<std::size_t>(k)];
  for (int k = 4; k >= 1; --k) m.velocity = m.velocity * s + k * c_[static_cast<std::size_t>(k)];
  for (int k = 4; k >= 2; --k)
    m.acceleration = m.acceleration * s + k * (k - 1) * c_[static_cast<std::size_t>(k)];
  return m;
}

Hand::Hand(const HandConfig& config, std::uint64_t seed) noexcept
    : config_(config), random_(seed, Random::kHand) {
  double sum = 0;
  for (std::size_t k = 0; k < kTremors; ++k) {
    tremor_amplitude_[k] = random_.uniform(0.5, 1);
    tremor_omega_[k] = 2 * kPi * random_.uniform(8, 12);
    tremor_phase_[k] = random_.uniform(0, 2 * kPi);
    sum += tremor_amplitude_[k];
  }
  for (std::size_t k = 0; k < kTremors; ++k) {
    tremor_amplitude_[k] *= config_.tremor_peak / sum;
    tremor_speed_ += tremor_amplitude_[k] * tremor_omega_[k];
  }
  sum = 0;
  for (std::size_t k = 0; k < kWanders; ++k) {
    wander_amplitude_[k] = random_.uniform(0.3, 1);
    wander_omega_[k] = 2 * kPi * random_.uniform(0.2, 1.5);
    wander_phase_[k] = random_.uniform(0, 2 * kPi);
    sum += wander_amplitude_[k];
  }
  for (auto& w : wander_amplitude_) w *= config_.wander / sum;
  fraction_ = random_.uniform();
  envelope_ = Quintic({}, 0, 1);
}

Motion Hand::warp(double t) const noexcept {
  Motion m{.angle = t, .velocity = 1, .acceleration = 0};
  for (std::size_t k = 0; k < kWanders; ++k) {
    const double x = wander_omega_[k] * t + wander_phase_[k];
    m.angle += wander_amplitude_[k] / wander_omega_[k] * std::sin(x);
    m.velocity += wander_amplitude_[k] * std::cos(x);
    m.acceleration -= wander_amplitude_[k] * wander_omega_[k] * std::sin(x);
  }
  return m;
}

Motion Hand::path(double tau) const noexcept {
  const Segment* segment = &segments_.front();
  for (const auto& s : segments_) {
    if (tau >= s.start) segment = &s;
  }
  return segment->path.at(tau - segment->start);
}

Motion Hand::at(double t) const noexcept {
  const Motion tau = warp(t);
  const Motion q = path(tau.angle);
  // φ = q(τ): φ̇ = q' τ̇, φ̈ = q'' τ̇² + q' τ̈.
  Motion m{.angle = q.angle,
           .velocity = q.velocity * tau.velocity,
           .acceleration = q.acceleration * tau.velocity * tau.velocity + q.velocity * tau.acceleration};
  const Motion e = envelope_.at(t - envelope_start_);
  if (e.angle == 0 && e.velocity == 0) return m;
  Motion x{};
  for (std::size_t k = 0; k < kTremors; ++k) {
    const double omega = tremor_omega_[k];
    const double s = std::sin(omega * t + tremor_phase_[k]);
    const double c = std::cos(omega * t + tremor_phase_[k]);
    x.angle += tremor_amplitude_[k] * s;
    x.velocity += tremor_amplitude_[k] * omega * c;
    x.acceleration -= tremor_amplitude_[k] * omega * omega * s;
  }
  m.angle += e.angle * x.angle;
  m.velocity += e.velocity * x.angle + e.angle * x.velocity;
  m.acceleration += e.acceleration * x.angle + 2 * e.velocity * x.velocity + e.angle * x.acceleration;
  return m;
}

Motion Hand::in_warped_time(double t, const Motion& now, bool held) const noexcept {
  const Motion tau = warp(t);
  if (held) return path(tau.angle);  // the tremor goes on by itself
  const double v = now.velocity / tau.velocity;
  return {.angle = now.angle,
          .velocity = v,
          .acceleration = (now.acceleration - v * tau.acceleration) / (tau.velocity * tau.velocity)};
}

void Hand::begin(double t, const Motion& now, bool held, double target, double speed,
                 double tremor) noexcept {
  const Motion from = in_warped_time(t, now, held);
  target = std::clamp(target, -config_.end_position, config_.end_position);
  const double distance = std::abs(target - from.angle);
  const double duration = std::max(kShortestLeadIn, kPeakOfStroke * distance / std::min(speed, kLeadInSpeed));
  const Motion envelope = held ? envelope_.at(t - envelope_start_) : Motion{};
  envelope_ = Quintic(envelope, tremor, duration);
  envelope_start_ = t;
  segments_[0] = {.start = warp(t).angle, .path = Quintic(from, target, duration)};
  lead_in_end_ = segments_[0].start + duration;
  pause_next_ = true;
  for (std::size_t k = 1; k < kPlanned; ++k) plan(segments_[k], segments_[k - 1]);
}

void Hand::hold(double t, const Motion& now, bool held, double angle, bool clamp) noexcept {
  sweeping_ = false;
  begin(t, now, held, angle, kLeadInSpeed, clamp ? 0 : 1);
}

void Hand::sweep(double t, const Motion& now, bool held, const Sweep& sweep) noexcept {
  sweeping_ = true;
  sweep_ = sweep;
  side_ = 1;
  const double speed = stroke_speed_limit();
  begin(t, now, held, sweep_.middle - sweep_.amplitude, speed, 1);
}

double Hand::stroke_speed_limit() const noexcept {
  // |φ̇| ≤ v (1 + w) + tremor; a tremor that is faster than the sweep asked for leaves a tenth of it to the stroke.
  return std::max(sweep_.speed - tremor_speed_, 0.1 * sweep_.speed) / (1 + config_.wander);
}

void Hand::plan(Segment& segment, const Segment& before) noexcept {
  segment.start = before.start + before.path.duration();
  const Motion from{.angle = before.path.at(before.path.duration()).angle};
  if (!sweeping_) {
    segment.path = Quintic(from, from.angle, 1.0);
    return;
  }
  if (pause_next_) {
    pause_next_ = false;
    segment.path = Quintic(from, from.angle, random_.uniform(0.06, sweep_.vary_speed ? 0.2 : 0.35));
    return;
  }
  pause_next_ = true;
  double speed = stroke_speed_limit();
  double reach = random_.uniform(0.96, 1.0);
  if (sweep_
          .vary_speed) {  // all speeds, evenly: the golden-ratio sequence leaves no gaps; slow strokes end anywhere
    fraction_ = std::fmod(fraction_ + kGoldenRatio, 1.0);
    speed *= 0.05 + 0.95 * fraction_;
    reach = fraction_ > 0.8 ? reach : random_.uniform(0.4, 1.0);
  } else {
    speed *= random_.uniform(0.92, 1.0);
  }
  const double target = std::clamp(sweep_.middle + side_ * reach * sweep_.amplitude, -config_.end_position,
                                   config_.end_position);
  side_ = -side_;
  const double duration = kPeakOfStroke * std::abs(target - from.angle) / speed;
  segment.path = Quintic(from, target, std::max(duration, kShortestStroke));
}

void Hand::forget_before(double t) noexcept {
  const double tau = warp(t).angle;
  while (tau > segments_[1].start) {
    std::rotate(segments_.begin(), segments_.begin() + 1, segments_.end());
    plan(segments_[kPlanned - 1], segments_[kPlanned - 2]);
  }
}

}  // namespace isac::simulate
