// What enters the equations: the measured signals, freed of what the model says of their sensors.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <memory>

#include "isac/explain/encoder_motion.hpp"
#include "isac/explain/filters.hpp"
#include "isac/explain/predict_parts.hpp"
#include "isac/explain/slip_moment.hpp"

namespace isac::explain {
namespace {

using models::Hook;
using models::JointPoint;

constexpr int kInversions = 3;  // of a reading: the error after k of them is (relative change)^(k + 1)

/// Cubic Hermite value of a low-passed signal and its derivative at a time between samples.
double between(const std::vector<double>& x, const std::vector<double>& slope, double at, double dt) {
  const double last = static_cast<double>(x.size() - 1);
  at = std::clamp(at, 0.0, last);
  const auto i = std::min(static_cast<std::size_t>(at), x.size() - 2);
  const double s = at - static_cast<double>(i);
  const double a = x[i], b = x[i + 1], da = slope[i] * dt, db = slope[i + 1] * dt;
  return a + s * (da + s * (3 * (b - a) - 2 * da - db + s * (2 * (a - b) + da + db)));
}

double linear_between(const std::vector<double>& x, double at) {
  at = std::clamp(at, 0.0, static_cast<double>(x.size() - 1));
  const auto i = std::min(static_cast<std::size_t>(at), x.size() - 2);
  const double s = at - static_cast<double>(i);
  return (1 - s) * x[i] + s * x[i + 1];
}

/// A count of the encoder: the sample at which it is first read, which way it went, and by how many steps.
struct Count {
  std::size_t sample;
  double way, steps;
};

std::vector<Count> counts_of(const std::vector<double>& angle, double step) {
  std::vector<Count> counts;
  for (std::size_t k = 1; k < angle.size(); ++k) {
    const double change = angle[k] - angle[k - 1];
    if (std::abs(change) > 0.5 * step)
      counts.push_back({k, change > 0 ? 1.0 : -1.0, std::round(std::abs(change) / step)});
  }
  return counts;
}

/// Value at `at` of the polynomial through n points.
double lagrange(const double* t, const double* y, int n, double at) {
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    double share = y[i];
    for (int j = 0; j < n; ++j)
      if (j != i) share *= (at - t[j]) / (t[i] - t[j]);
    sum += share;
  }
  return sum;
}

/// A reading with play stands half the play behind the motion. Between the last count one way and the first one back the reading
/// stands, and the joint goes on, turns and crosses the play: it passed the same edge of the encoder's step at both counts, half the play on
/// either side, and the edge before at the counts before and after. A polynomial through these four says where it was between; what it
/// says without play is taken off again, for an encoder without play is no better read for it.
void undo_play(double step, double half, std::vector<double>& angle) {
  const std::vector<Count> counts = counts_of(angle, step);
  if (counts.empty()) return;
  // Where in its play it started is not known; from the first count on it is.
  for (std::size_t k = 0; k < counts.front().sample; ++k) angle[k] += half * counts.front().way;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const Count& count = counts[i];
    const bool last = i + 1 == counts.size();
    const std::size_t end = last ? angle.size() : counts[i + 1].sample;
    if (last || counts[i + 1].way == count.way) {
      for (std::size_t k = count.sample; k < end; ++k) angle[k] += half * count.way;
      continue;
    }
    const auto time = [&](std::size_t c) { return static_cast<double>(counts[c].sample) - 0.5; };
    double t[4] = {time(i), time(i + 1)}, with[4] = {half, -half}, without[4] = {0, 0};
    int n = 2;
    if (i > 0 && counts[i - 1].way == count.way && count.steps < 1.5) {
      t[n] = time(i - 1);
      without[n] = -step;
      with[n++] = half - step;
    }
    if (i + 2 < counts.size() && counts[i + 2].way != count.way && counts[i + 1].steps < 1.5) {
      t[n] = time(i + 2);
      without[n] = -step;
      with[n++] = -half - step;
    }
    for (std::size_t k = count.sample; k < end; ++k) {
      const auto at = static_cast<double>(k);
      angle[k] += count.way * (std::clamp(lagrange(t, with, n, at), -half, half + step) -
                               std::clamp(lagrange(t, without, n, at), 0.0, step));
    }
  }
}

/// Is one signal the other and a constant?
bool is_shift_of(const std::vector<double>& x, const std::vector<double>& y) {
  constexpr double kRounding = 1e-13;  // rad
  for (std::size_t k = 1; k < x.size(); ++k)
    if (!(std::abs((y[k] - x[k]) - (y[0] - x[0])) <= kRounding)) return false;
  return true;
}

/// What a linear effect makes of an angle's reading, φ + δ with δ = c + a φ + b t, by its values at four points.
struct AngleReading {
  double constant, by_angle, by_time;

  explicit AngleReading(const Active& a) {
    const auto delta = [&](double angle, double time) {
      models::Readings<double> y;
      y.angle = angle;
      models::effect_reading(a.hypothesis->effect, a.values.data(), time, static_cast<const double*>(nullptr),
                             y);
      return y.angle - angle;
    };
    constant = delta(0, 0);
    by_angle = 0.5 * (delta(1, 0) - delta(-1, 0));
    by_time = delta(0, 1) - constant;
  }
  double undone(double read, double time) const {
    return (read - constant - by_time * time) / (1 + by_angle);
  }
};

/// What of a model decides about something on one run: the effects that enter it and are there, with their values.
template <typename Enters>
std::vector<double> key_of(const ModelPoint& model, const PreparedRun& run, Enters&& enters) {
  std::vector<double> key;
  for (const Active& a : model.effects) {
    const Hypothesis& h = *a.hypothesis;
    if (!enters(h) || is_null(a)) continue;
    if (is_slip(h) && !run.time.empty() && time_of(h, run, run.time.size() - 1) < a.values[kSlipMoment])
      continue;  // it is still to come
    key.push_back(h.effect);
    key.push_back(h.clock == Clock::kDay ? 1 : 0);
    key.insert(key.end(), a.values.begin(), a.values.end());
  }
  return key;
}

/// Of each run the parts of two models: most models of a search differ elsewhere. Two are kept, for a search goes back and forth between the
/// model where it stands and others that read otherwise; the one that was never asked for again goes first.
template <typename Part>
class Kept {
 public:
  template <typename Make>
  std::shared_ptr<const Part> of(std::size_t run, std::uint64_t predictor, std::vector<double> key,
                                 Make&& make) {
    if (runs_.size() <= run) runs_.resize(run + 1);
    ++now_;
    for (One& one : runs_[run])
      if (one.part != nullptr && one.predictor == predictor && one.key == key) {
        one.asked_again = now_;
        return one.part;
      }
    One& other = runs_[run][runs_[run][0].asked_again <= runs_[run][1].asked_again ? 0 : 1];
    other = {.predictor = predictor, .asked_again = 0, .key = std::move(key), .part = nullptr};
    return other.part = make();
  }

 private:
  struct One {
    std::uint64_t predictor = 0, asked_again = 0;
    std::vector<double> key;
    std::shared_ptr<const Part> part;
  };
  std::vector<std::array<One, 2>> runs_;
  std::uint64_t now_ = 0;
};

}  // namespace

/// Offsets, gains and drifts are smooth: they can be undone in the low-passed signals. Jumps and play cannot. A joint that rests stands
/// still however its reading drifts within a step of the encoder.
void Predictor::undo_angle_readings(const ModelPoint& model, std::size_t index, Motions& in) const {
  const PreparedRun& run = data_->runs[index];
  const bool rests = std::find(resting_.begin(), resting_.end(), index) != resting_.end();
  std::vector<const Active*> readings;
  bool smooth = true;
  for (const Active& a : model.effects) {
    if (!a.hypothesis->reads_angle || a.hypothesis->info().hook == Hook::kDelay || is_null(a)) continue;
    readings.push_back(&a);
    smooth = smooth && a.hypothesis->info().linear;
  }
  const std::size_t n = run.raw_angle.size();
  const double dt = run.interval;
  std::vector<double> truth = smooth ? run.angle : run.raw_angle;
  for (auto it = readings.rbegin(); it != readings.rend(); ++it) {  // the last first
    const Hypothesis& h = *(*it)->hypothesis;
    const double* q = (*it)->values.data();
    if (h.info().state_count > 0) {
      undo_play(data_->rig.angle_step, q[0], truth);
      continue;
    }
    if (h.info().linear) {
      const AngleReading reading(**it);
      for (std::size_t k = 0; k < n; ++k)
        truth[k] = reading.undone(truth[k], time_of(h, run, rests ? n / 2 : k));
      continue;
    }
    const std::vector<double> read = truth;
    for (int round = 0; round < kInversions; ++round)
      for (std::size_t k = 0; k < n; ++k) {
        models::Readings<double> y;
        y.angle = truth[k];
        models::effect_reading(h.effect, q, time_of(h, run, k), static_cast<const double*>(nullptr), y);
        truth[k] = read[k] - (y.angle - truth[k]);
      }
  }
  double by_angle = 0, by_time = 0;
  for (const Active* a : readings) {
    if (!a->hypothesis->info().linear) continue;
    const AngleReading reading(*a);
    by_angle += reading.by_angle;
    if (!rests) by_time += reading.by_time;
  }
  const double ratio = 1 / (1 + by_angle);
  const bool slow = !run.slow_acceleration.empty();
  if (!smooth && is_shift_of(run.raw_angle, truth)) {
    // A slip before this run, or after it: what is even, no derivative sees.
    const double shift = n > 0 ? truth[0] - run.raw_angle[0] : 0.0;
    in.own_angle = run.angle;
    for (double& angle : in.own_angle) angle += shift;
    in.angle = &in.own_angle;
    return;
  }
  if (smooth) {
    in.own_velocity = run.velocity;
    in.own_acceleration = run.acceleration;
    if (slow) in.own_slow_acceleration = run.slow_acceleration;
    for (std::size_t k = 0; k < n; ++k) {
      in.own_velocity[k] = (run.velocity[k] - by_time) * ratio;
      in.own_acceleration[k] = run.acceleration[k] * ratio;
      if (slow) in.own_slow_acceleration[k] = run.slow_acceleration[k] * ratio;
    }
    if (in.swing != nullptr) {
      in.own_swing = *in.swing;
      // What hangs on the joint knows its motion only, no angle of its own: drifts and offsets are nothing to it.
      for (auto* signal : {&in.own_swing.angle, &in.own_swing.velocity, &in.own_swing.acceleration})
        for (double& value : *signal) value *= ratio;
      in.swing = &in.own_swing;
    }
    in.own_angle = std::move(truth);
  } else {
    const double sigma = data_->smoothing.torque / dt;
    in.own_angle = low_pass(truth, sigma);
    in.own_velocity = quiet_velocity(truth, sigma, dt, data_->rig.angle_step * ratio);
    hush_beats(truth, dt, data_->rig.angle_step * ratio, in.own_angle, in.own_velocity);
    in.own_acceleration = low_pass_derivative(truth, sigma, dt, 2);
    if (slow)
      in.own_slow_acceleration =
          quiet_acceleration(truth, data_->smoothing.motion / dt, dt, data_->rig.angle_step * ratio);
    if (in.swing != nullptr) {
      in.own_swing = quiet_motion(truth, sigma, dt, data_->rig.angle_step * ratio);
      in.swing = &in.own_swing;
    }
  }
  in.angle = &in.own_angle;
  in.velocity = &in.own_velocity;
  in.acceleration = &in.own_acceleration;
  if (slow) in.slow_acceleration = &in.own_slow_acceleration;
}

std::shared_ptr<const Predictor::Motions> Predictor::motions_of(const ModelPoint& model,
                                                                std::size_t index) const {
  thread_local Kept<Motions> kept;
  const PreparedRun& run = data_->runs[index];
  return kept.of(index, identity_, key_of(model, run, [](const Hypothesis& h) { return h.reads_angle; }),
                 [&] { return make_motions(model, index); });
}

std::shared_ptr<const Predictor::Inputs> Predictor::inputs_of(const ModelPoint& model,
                                                              std::size_t index) const {
  thread_local Kept<Inputs> kept;
  const PreparedRun& run = data_->runs[index];
  const auto enters = [](const Hypothesis& h) {
    return h.reads_angle || h.reads_pressure || h.info().hook == Hook::kMusclePressure;
  };
  return kept.of(index, identity_, key_of(model, run, enters), [&] { return make_inputs(model, index); });
}

std::shared_ptr<const Predictor::Motions> Predictor::make_motions(const ModelPoint& model,
                                                                  std::size_t index) const {
  const PreparedRun& run = data_->runs[index];
  auto shared = std::make_shared<Motions>();
  Motions& in = *shared;
  in.angle = &run.angle;
  in.velocity = &run.velocity;
  in.acceleration = &run.acceleration;
  in.dry = &run.dry_velocity;
  in.slow_acceleration = &run.slow_acceleration;
  if (!run.swing.angle.empty()) in.swing = &run.swing;
  if (run.angle.empty()) return shared;
  const double dt = run.interval;
  double skew = 0;
  bool angle = false;
  for (const Active& a : model.effects) {
    if (!a.hypothesis->reads_angle) continue;
    if (a.hypothesis->info().hook == Hook::kDelay) {
      skew += models::effect_delay(a.hypothesis->effect, a.values.data());
    } else {
      angle = angle || !is_null(a);
    }
  }
  if (angle) undo_angle_readings(model, index, in);
  if (skew != 0) {
    const double shift = skew / dt;
    const std::vector<double> angle_at = *in.angle, velocity_at = *in.velocity,
                              acceleration_at = *in.acceleration, dry_at = *in.dry;
    in.own_angle.resize(angle_at.size());
    in.own_velocity.resize(angle_at.size());
    in.own_acceleration.resize(angle_at.size());
    in.own_dry.resize(angle_at.size());
    // A damping feels the shift by −D δ φ̈, in which the encoder's noise is the second derivative of what A r² φ leaves in the residual: the
    // fit would pay for less of it with a skew that is not there. Only the slow part of the velocity is moved.
    const std::vector<double> slowly = wide_low_pass(velocity_at, data_->smoothing.motion / dt);
    for (std::size_t k = 0; k < angle_at.size(); ++k) {
      const double at = static_cast<double>(k) + shift;
      in.own_angle[k] = between(angle_at, velocity_at, at, dt);
      in.own_velocity[k] = velocity_at[k] + linear_between(slowly, at) - slowly[k];
      in.own_acceleration[k] = linear_between(acceleration_at, at);
      in.own_dry[k] = linear_between(dry_at, at);
    }
    in.angle = &in.own_angle;
    in.velocity = &in.own_velocity;
    in.acceleration = &in.own_acceleration;
    in.dry = &in.own_dry;
    if (!in.slow_acceleration->empty()) {
      const std::vector<double> slow = *in.slow_acceleration;
      in.own_slow_acceleration.resize(slow.size());
      for (std::size_t k = 0; k < slow.size(); ++k)
        in.own_slow_acceleration[k] = linear_between(slow, static_cast<double>(k) + shift);
      in.slow_acceleration = &in.own_slow_acceleration;
    }
    if (in.swing != nullptr) {
      const Motion now = *in.swing;
      in.own_swing = now;
      for (std::size_t k = 0; k < now.angle.size(); ++k) {
        const double at = static_cast<double>(k) + shift;
        in.own_swing.angle[k] = between(now.angle, now.velocity, at, dt);
        in.own_swing.velocity[k] = linear_between(now.velocity, at);
        in.own_swing.acceleration[k] = linear_between(now.acceleration, at);
      }
      in.swing = &in.own_swing;
    }
  }
  return shared;
}

std::shared_ptr<const Predictor::Inputs> Predictor::make_inputs(const ModelPoint& model,
                                                                std::size_t index) const {
  const PreparedRun& run = data_->runs[index];
  static std::atomic<std::uint64_t> counter{0};
  auto shared = std::make_shared<Inputs>();
  Inputs& in = *shared;
  in.identity = ++counter;
  in.motions = motions_of(model, index);
  in.angle = in.motions->angle;
  in.velocity = in.motions->velocity;
  in.acceleration = in.motions->acceleration;
  in.dry = in.motions->dry;
  in.slow_acceleration = in.motions->slow_acceleration;
  in.swing = in.motions->swing;
  in.pressure[0] = &run.pressure[0];
  in.pressure[1] = &run.pressure[1];
  for (int i = 0; i < 2; ++i) in.first_pressure[i] = run.pressure[i].empty() ? 0.0 : run.pressure[i].front();
  const auto own = [&] {
    for (int i = 0; i < 2; ++i) {
      if (in.own_pressure[i].empty()) in.own_pressure[i] = *in.pressure[i];
      in.pressure[i] = &in.own_pressure[i];
    }
  };
  for (const Active& a : model.effects) {
    if (!run.has_pressure || !a.hypothesis->reads_pressure || is_null(a)) continue;
    own();
    const PressureReading made(a);
    for (int i = 0; i < 2; ++i)
      for (double& p : in.own_pressure[i]) p = (p - made.constant[i]) / made.slope[i];
  }
  if (!in.own_pressure[0].empty())
    for (int i = 0; i < 2; ++i) in.first_pressure[i] = in.own_pressure[i].front();
  if (run.angle.empty()) return shared;
  // What the muscles make force of: no sensor reads it and no valve fills it.
  for (const Active& a : model.effects) {
    if (!run.has_pressure || a.hypothesis->info().hook != Hook::kMusclePressure || is_null(a)) continue;
    own();
    for (std::size_t k = 0; k < in.own_pressure[0].size(); ++k) {
      double p[2] = {in.own_pressure[0][k], in.own_pressure[1][k]};
      models::effect_muscle_pressure(a.hypothesis->effect, a.values.data(), p);
      in.own_pressure[0][k] = p[0];
      in.own_pressure[1][k] = p[1];
    }
  }
  add_columns(index, in);
  return shared;
}

/// The terms of the baseline at the rows of the torque chain, one after another, for unit parameters. A row is low-passed, g ∗ φ̇³ is not
/// (g ∗ φ̇)³: to the second order of the kernel's σ it is w³ + 3 σ² w ẇ², w = g ∗ φ̇.
void Predictor::add_columns(std::size_t index, Inputs& in) const {
  const double one = 1, spread2 = data_->smoothing.torque * data_->smoothing.torque;
  in.columns.clear();
  for (std::size_t i = data_->run_begin[index]; i < data_->run_begin[index + 1]; ++i) {
    if (data_->rows[i].chain != Chain::kTorque) continue;
    const JointPoint<double> x = point_at(data_->rig, {}, *in.angle, *in.velocity, *in.acceleration,
                                          in.pressure, 0, data_->rows[i].sample);
    JointPoint<double> cubic = x;
    cubic.velocity =
        std::cbrt(x.velocity * (x.velocity * x.velocity + 3 * spread2 * x.acceleration * x.acceleration));
    for (std::size_t j = 0; j < terms_.size(); ++j)
      in.columns.push_back(
          term_sign_[j] *
          models::effect_torque(terms_[j], &one, static_cast<int>(j) == cubic_damping_ ? cubic : x));
  }
}

}  // namespace isac::explain
