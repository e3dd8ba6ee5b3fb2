/// @file
/// Plants with a known ultimate gain and period, written down anew (no code of the room): a chain of lags, perhaps a lead, a
/// swinging joint, dead time, a load, saturation and noise. The ultimate point follows from the phase in closed form.
#pragma once

#include <algorithm>
#include <cmath>
#include <deque>
#include <vector>

#include "isac/simulate/random.hpp"
#include "isac/tune/experiment.hpp"

namespace isac::test {

struct KnownPlant {
  double gain = 1;                        ///< rad/Pa
  std::vector<double> lags;               ///< s
  double lead = 0;                        ///< s, (1 + T_z s)
  double time_constant = 0, damping = 0;  ///< s, -; of the swinging part, 0: none
  double dead_time = 0;
  double load = 0;               ///< Pa, as if it were a command, from the excitation on
  double saturation = INFINITY;  ///< Pa, of the command less the centre
  double noise = 0, step = 0;    ///< rad, white, and of the encoder

  [[nodiscard]] double phase(double w) const {
    double p = -w * dead_time + std::atan(w * lead);
    for (const double t : lags) p -= std::atan(w * t);
    if (time_constant > 0)
      p -= std::atan2(2 * damping * w * time_constant, 1 - w * w * time_constant * time_constant);
    return p;
  }
  [[nodiscard]] double size(double w) const {
    double g = gain * std::hypot(1, w * lead);
    for (const double t : lags) g /= std::hypot(1, w * t);
    if (time_constant > 0)
      g /= std::hypot(1 - std::pow(w * time_constant, 2), 2 * damping * w * time_constant);
    return g;
  }
  /// The first ω at phase −π, by bisection on the unwrapped phase.
  [[nodiscard]] double critical() const {
    double a = 1e-3, b = a;
    while (phase(b) > -M_PI) b *= 1.05;
    a = b / 1.05;
    for (int i = 0; i < 80; ++i) (phase(0.5 * (a + b)) > -M_PI ? a : b) = 0.5 * (a + b);
    return a;
  }
};

/// Latency and adjustment time of a unit step by the tangent at its steepest point, on a finely simulated answer.
struct KnownTangent {
  double latency = 0, adjustment = 0;
};
inline KnownTangent tangent_of(const KnownPlant& plant) {
  double least = plant.time_constant > 0 ? plant.time_constant : 1.0;
  for (const double t : plant.lags) least = std::min(least, t);
  const double h = 2e-3 * least, w = plant.time_constant > 0 ? 1 / plant.time_constant : 0;
  std::vector<double> lag(plant.lags.size(), 0.0);
  double angle = 0, speed = 0, last = 0, before = 0;
  KnownTangent best;
  double steepest = 0;
  for (int k = 1; k < 2000000; ++k) {
    double x = 1;
    for (std::size_t i = 0; i < lag.size(); ++i) {
      const double old = lag[i];
      lag[i] = x + (lag[i] - x) * std::exp(-h / plant.lags[i]);
      const double share = i == 0 ? plant.lead / plant.lags[0] : 0.0;
      x = share * x + (1 - share) * 0.5 * (old + lag[i]);
    }
    if (w > 0) {
      const auto pull = [&](double a, double v) { return w * w * (x - a) - 2 * plant.damping * w * v; };
      const double k1 = pull(angle, speed), k2 = pull(angle + h / 2 * speed, speed + h / 2 * k1);
      const double k3 = pull(angle + h / 2 * (speed + h / 2 * k1), speed + h / 2 * k2);
      const double k4 = pull(angle + h * (speed + h / 2 * k2), speed + h * k3);
      angle += h * (speed + h / 6 * (k1 + k2 + k3));
      speed += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    } else {
      angle = lag.back();
      speed = (angle - before) / h;
    }
    before = angle;
    if (speed > steepest) {
      steepest = speed;
      const double t = (k - (w > 0 ? 0.0 : 0.5)) * h;
      const double y = w > 0 ? angle : angle - 0.5 * h * speed;
      best = {plant.dead_time + t - y / speed, 1 / speed};
    } else if (speed < 0.5 * last && k * h > 20 * least) {
      break;
    }
    last = steepest;
  }
  return best;
}

/// How a plant moves from rest under a command held over parts of a tick.
class PlantMotion {
 public:
  PlantMotion(const KnownPlant& plant, double part)
      : plant_(plant),
        part_(part),
        lag_(plant.lags.size(), 0.0),
        tube_(static_cast<std::size_t>(std::lround(plant.dead_time / part)), 0.0) {}

  [[nodiscard]] double angle() const { return plant_.time_constant > 0 ? angle_ : lag_.back(); }

  void advance(double u) {
    const double h = part_;
    tube_.push_back(u);
    double x = plant_.gain * tube_.front();
    tube_.pop_front();
    for (std::size_t i = 0; i < lag_.size(); ++i) {  // exact for what is held over the part
      const double before = lag_[i];
      lag_[i] = x + (lag_[i] - x) * std::exp(-h / plant_.lags[i]);
      // the lead is on the first lag: (1 + T_z s)/(1 + T s) = T_z/T + (1 − T_z/T)/(1 + T s); what goes on is the middle of the part
      const double share = i == 0 ? plant_.lead / plant_.lags[0] : 0.0;
      x = share * x + (1 - share) * 0.5 * (before + lag_[i]);
    }
    if (plant_.time_constant <= 0) return;
    const double w = 1 / plant_.time_constant;  // Runge-Kutta with x at the middle of the part
    const auto pull = [&](double a, double v) { return w * w * (x - a) - 2 * plant_.damping * w * v; };
    const double k1 = pull(angle_, speed_), k2 = pull(angle_ + h / 2 * speed_, speed_ + h / 2 * k1);
    const double k3 = pull(angle_ + h / 2 * (speed_ + h / 2 * k1), speed_ + h / 2 * k2);
    const double k4 = pull(angle_ + h * (speed_ + h / 2 * k2), speed_ + h * k3);
    angle_ += h * (speed_ + h / 6 * (k1 + k2 + k3));
    speed_ += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
  }

 private:
  KnownPlant plant_;
  double part_, angle_ = 0, speed_ = 0;
  std::vector<double> lag_;
  std::deque<double> tube_;
};

constexpr int kParts = 10;  // of a tick

/// Plays an experiment on a plant; returns it finished. Ticks tremble by a share of the interval.
inline void play(tune::Experiment& experiment, const KnownPlant& plant, double interval,
                 simulate::Random& random) {
  PlantMotion motion(plant, interval / kParts);
  for (int tick = 0; !experiment.finished(); ++tick) {
    double seen = motion.angle() + plant.noise * random.normal();
    if (plant.step > 0) seen = plant.step * std::round(seen / plant.step);
    double u = experiment.step(tick * interval + 0.02 * interval * random.uniform(), seen) -
               experiment.settings().centre;
    u = std::clamp(u, -plant.saturation, plant.saturation);
    if (experiment.state() == tune::Experiment::State::kExcite) u += plant.load;
    for (int n = 0; n < kParts; ++n) motion.advance(u);
  }
}

/// The k-th kind of plant of a family of three; times in seconds, gain 1 rad per 1e5 Pa or so.
inline KnownPlant random_plant(simulate::Random& random, int kind) {
  KnownPlant p;
  const double scale = std::exp(random.uniform(std::log(0.5), std::log(2.0)));
  p.gain = 4e-6 * std::exp(random.uniform(-1, 1));
  p.dead_time = random.uniform() < 0.3
                    ? 0.0
                    : 1e-4 * std::round(1e4 * scale * random.uniform(0.002, 0.05));  // whole parts of a tick
  if (kind == 0) {  // the joint behind its valve unit
    p.lags = {scale * random.uniform(0.05, 0.3)};
    p.time_constant = scale * random.uniform(0.02, 0.06);
    p.damping = random.uniform(0.15, 1.2);
  } else if (kind == 1) {  // four lags: one more than is fitted
    for (int i = 0; i < 4; ++i)
      p.lags.push_back(scale * std::exp(random.uniform(std::log(0.01), std::log(0.2))));
  } else {  // joint, valve unit, amplifier, and a lead
    p.lags = {scale * random.uniform(0.1, 0.3), scale * random.uniform(0.005, 0.02)};
    p.lead = p.lags[0] * random.uniform(0.02, 0.15);
    p.time_constant = scale * random.uniform(0.02, 0.06);
    p.damping = random.uniform(0.2, 1.0);
  }
  return p;
}

}  // namespace isac::test
