#include "isac/explain/predict.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "isac/core/units.hpp"
#include "isac/models/effect_hooks.hpp"

namespace isac::explain {
namespace {

using models::Hook;
using models::JointPoint;
using models::Subsystem;

constexpr int kInversions = 3;  // of a reading: the error after k of them is (relative change)^(k + 1)

double time_of(const Hypothesis& h, const PreparedRun& run, std::size_t k) {
  return run.time[k] + (h.clock == Clock::kDay ? run.day_offset : 0.0);
}

bool is_null(const Active& a) {
  return null_values(*a.hypothesis, a.values) == a.values;
}

/// (e^s − 1)/s; where s is small, by its series to 1e-9.
double growth(double s) {
  return std::abs(s) < 0.03 ? 1 + s * (0.5 + s * (1.0 / 6 + s * (1.0 / 24 + s / 120))) : std::expm1(s) / s;
}

/// dz/dt along a path of inputs that is smooth within a sample, by an exponential Rosenbrock–Euler step (exact where the
/// equation is linear in its state, as Dahl's and the creep's are between reversals) for one state, by RK4 for two.
class Memory {
 public:
  Memory(const Active& active) : active_(active), count_(active.hypothesis->info().state_count) {}
  void rest(const JointPoint<double>& x) {
    models::effect_rest(active_.hypothesis->effect, active_.values.data(), x, z_);
  }
  const double* state() const { return z_; }
  void step(const JointPoint<double>& from, const JointPoint<double>& to, double dt) {
    JointPoint<double> middle = to;
    middle.angle = 0.5 * (from.angle + to.angle);
    middle.velocity = 0.5 * (from.velocity + to.velocity);
    if (count_ == 1) {
      // A state that slips at its limit must not run past it within a sample.
      const double first = rate(middle, z_[0]);
      if (first == 0) return;
      const int parts =
          active_.hypothesis->dry ? std::clamp(static_cast<int>(std::abs(first) * dt / 0.03), 1, 16) : 1;
      const double h = dt / parts;
      for (int part = 0; part < parts; ++part) {
        const double f = part == 0 ? first : rate(middle, z_[0]);
        constexpr double kNudge = 1e-6;
        const double slope = (rate(middle, z_[0] + kNudge) - f) / kNudge * h;
        z_[0] += h * f * growth(std::min(slope, 5.0));
      }
      return;
    }
    const auto f = [&](const double* z, const JointPoint<double>& x, double* dz) {
      models::effect_derivative(active_.hypothesis->effect, active_.values.data(), x, z, dz);
    };
    double k1[2], k2[2], k3[2], k4[2], y[2];
    f(z_, from, k1);
    for (int i = 0; i < 2; ++i) y[i] = z_[i] + 0.5 * dt * k1[i];
    f(y, middle, k2);
    for (int i = 0; i < 2; ++i) y[i] = z_[i] + 0.5 * dt * k2[i];
    f(y, middle, k3);
    for (int i = 0; i < 2; ++i) y[i] = z_[i] + dt * k3[i];
    f(y, to, k4);
    for (int i = 0; i < 2; ++i) z_[i] += dt / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
  }

 private:
  double rate(const JointPoint<double>& x, double z) const {
    double dz = 0;
    models::effect_derivative(active_.hypothesis->effect, active_.values.data(), x, &z, &dz);
    return dz;
  }
  const Active& active_;
  int count_;
  double z_[models::kMaxEffectStates] = {};
};

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

}  // namespace

namespace {

JointPoint<double> point_at(const RigFacts& rig, double stiffness, double pressure_gain,
                            const std::vector<double>& angle, const std::vector<double>& velocity,
                            const std::vector<double>& acceleration,
                            const std::vector<double>* const (&pressure)[2], double time, std::size_t k) {
  JointPoint<double> x;
  x.angle = angle[k];
  x.velocity = velocity[k];
  x.acceleration = acceleration[k];
  if (pressure[0] != nullptr && !pressure[0]->empty()) {
    const double p1 = (*pressure[0])[k], p2 = (*pressure[1])[k];
    x.delta_pressure = 0.5 * (p2 - p1);
    x.mean_pressure = 0.5 * (p1 + p2);
  }
  x.time = time;
  x.wheel_radius = std::isfinite(rig.wheel_radius) ? rig.wheel_radius : 1.0;
  x.reference_pressure = rig.initial_pressure;
  x.stiffness = stiffness;
  x.pressure_gain = pressure_gain;
  return x;
}

}  // namespace

/// What enters the equations: the measured signals, or what they were before sensors changed them.
struct Predictor::Inputs {
  const std::vector<double>*angle = nullptr, *velocity = nullptr, *acceleration = nullptr, *dry = nullptr,
        *slow_acceleration = nullptr;
  const std::vector<double>* pressure[2] = {nullptr, nullptr};
  std::vector<double> own_angle, own_velocity, own_acceleration, own_dry, own_slow_acceleration,
      own_pressure[2];
  std::vector<double> columns;  ///< row-major: rows of the torque chain × terms
};

Predictor::Predictor(const Prepared& data) : data_(&data) {
  static std::atomic<std::uint64_t> made{0};
  identity_ = ++made;
  const bool seed = data.baseline.terms.empty();
  const std::vector<std::string> names =
      seed ? std::vector<std::string>{"A", "B", "C", "D"} : data.baseline.terms;
  for (const std::string& name : names) {
    const int e = models::find_effect(name);
    const models::EffectInfo& info = models::effect_catalogue()[static_cast<unsigned>(e)];
    const auto& p = info.parameters[0];
    terms_.push_back(e);
    term_sign_.push_back(data.baseline.driven && !info.added_to_output ? -1.0 : 1.0);
    if (std::string_view(info.id) == "stiffness") stiffness_ = static_cast<int>(base_.size());
    if (std::string_view(info.id) == "pressure") pressure_gain_ = static_cast<int>(base_.size());
    base_.push_back({.name = seed ? name : p.name,
                     .unit = p.unit,
                     .si_per_unit = p.si_per_unit,
                     .start = p.typical,
                     .lower = seed ? -1e9 : p.lower,
                     .upper = seed ? 1e9 : p.upper,
                     .chains = bit(Chain::kTorque)});
    if (!seed) base_.back().lower = std::min(base_.back().lower, -1e9);
  }
  if (data.has(Chain::kPressure1) || data.has(Chain::kPressure2)) {
    const auto valve = [&](const char* name, const char* unit, double start, double lower) {
      base_.push_back({.name = name,
                       .unit = unit,
                       .si_per_unit = 1,
                       .start = start,
                       .lower = lower,
                       .upper = 3,
                       .chains = kPressureChains});
      return static_cast<int>(base_.size()) - 1;
    };
    gain_ = valve("K_C", "-", 1, 0.3);
    lag_ = valve("T_C", "s", 0.17, 0.005);
  }
  for (std::size_t r = 0; r < data.runs.size(); ++r) {
    const auto& angle = data.runs[r].raw_angle;
    if (angle.empty() || !data.runs[r].has_torque || stiffness_ < 0 || !std::isfinite(data.rig.angle_step))
      continue;
    const auto [low, high] = std::minmax_element(angle.begin(), angle.end());
    if (*high - *low <= 2.01 * data.rig.angle_step) resting_.push_back(r);
  }
  measured_.resize(static_cast<Eigen::Index>(rows()));
  for (std::size_t i = 0; i < rows(); ++i) {
    const Row& row = data.rows[i];
    const PreparedRun& run = data.runs[row.run];
    const std::size_t k = row.sample;
    measured_[static_cast<Eigen::Index>(i)] =
        row.chain == Chain::kTorque   ? run.smooth_torque[k]
        : row.chain == Chain::kMotion ? run.slow_torque[k]
                                      : run.smooth_pressure[row.chain == Chain::kPressure1 ? 0 : 1][k];
  }
}

namespace {

/// A reading with play stands half the play behind the motion; while it stands still after a turn, the joint crosses the play,
/// slowly at first.
void undo_play(const std::vector<double>& velocity, double half, std::vector<double>& angle) {
  double side = 0;
  std::size_t moved = 0;  // the sample after the last one in motion
  for (std::size_t k = 0; k < angle.size(); ++k) {
    if (velocity[k] == 0) continue;
    const double now = velocity[k] > 0 ? 1.0 : -1.0;
    if (side == 0) side = now;  // where in its play it started is not known; from the first motion on it is
    for (std::size_t i = moved; i < k; ++i) {
      const double share = static_cast<double>(i - moved + 1) / static_cast<double>(k - moved + 1);
      angle[i] += half * (side + (now - side) * share * share);
    }
    angle[k] += half * now;
    side = now;
    moved = k + 1;
  }
  for (std::size_t i = moved; i < angle.size(); ++i) angle[i] += half * side;
}

}  // namespace

/// Offsets, gains and drifts are smooth: they can be undone in the low-passed signals. Jumps and play cannot.
void Predictor::undo_angle_readings(const ModelPoint& model, const PreparedRun& run, Inputs& in) const {
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
      undo_play(run.dry_velocity, q[0], truth);
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
  const bool slow = !run.slow_acceleration.empty();
  if (smooth) {
    in.own_velocity = run.velocity;
    in.own_acceleration = run.acceleration;
    if (slow) in.own_slow_acceleration = run.slow_acceleration;
    // φ_true = φ − δ with δ linear in φ and in t: the slopes of δ from two angles and two times.
    double by_angle = 0, by_time = 0;
    for (const Active* a : readings) {
      const auto delta = [&](double angle, double time) {
        models::Readings<double> y;
        y.angle = angle;
        models::effect_reading(a->hypothesis->effect, a->values.data(), time,
                               static_cast<const double*>(nullptr), y);
        return y.angle - angle;
      };
      by_angle += 0.5 * (delta(1, 0) - delta(-1, 0));
      by_time += delta(0, 1) - delta(0, 0);
    }
    const double ratio = 1 / (1 + by_angle);
    for (std::size_t k = 0; k < n; ++k) {
      in.own_velocity[k] = (run.velocity[k] - by_time) * ratio;
      in.own_acceleration[k] = run.acceleration[k] * ratio;
      if (slow) in.own_slow_acceleration[k] = run.slow_acceleration[k] * ratio;
    }
    in.own_angle = std::move(truth);
  } else {
    const double sigma = data_->smoothing.torque / dt;
    in.own_angle = low_pass(truth, sigma);
    in.own_velocity = low_pass_derivative(truth, sigma, dt, 1);
    in.own_acceleration = low_pass_derivative(truth, sigma, dt, 2);
    if (slow) in.own_slow_acceleration = low_pass_derivative(truth, data_->smoothing.motion / dt, dt, 2);
  }
  in.angle = &in.own_angle;
  in.velocity = &in.own_velocity;
  in.acceleration = &in.own_acceleration;
  if (slow) in.slow_acceleration = &in.own_slow_acceleration;
}

/// Inputs of the last model on this run that changed them the same way: most models of a search differ elsewhere.
std::shared_ptr<const Predictor::Inputs> Predictor::inputs_of(const ModelPoint& model,
                                                              std::size_t index) const {
  std::vector<double> key;
  for (const Active& a : model.effects) {
    const Hypothesis& h = *a.hypothesis;
    if (!(h.reads_angle || h.reads_pressure || h.info().hook == Hook::kMusclePressure) || is_null(a))
      continue;
    key.push_back(h.effect);
    key.push_back(h.clock == Clock::kDay ? 1 : 0);
    key.insert(key.end(), a.values.begin(), a.values.end());
  }
  struct Kept {
    std::uint64_t predictor = 0;
    std::vector<double> key;
    std::shared_ptr<const Inputs> inputs;
  };
  thread_local std::vector<Kept> kept;
  if (kept.size() <= index) kept.resize(index + 1);
  Kept& k = kept[index];
  if (k.inputs == nullptr || k.predictor != identity_ || k.key != key) {
    k.inputs = make_inputs(model, index);
    k.predictor = identity_;
    k.key = std::move(key);
  }
  return k.inputs;
}

std::shared_ptr<const Predictor::Inputs> Predictor::make_inputs(const ModelPoint& model,
                                                                std::size_t index) const {
  const PreparedRun& run = data_->runs[index];
  auto shared = std::make_shared<Inputs>();
  Inputs& in = *shared;
  in.angle = &run.angle;
  in.velocity = &run.velocity;
  in.acceleration = &run.acceleration;
  in.dry = &run.dry_velocity;
  in.slow_acceleration = &run.slow_acceleration;
  in.pressure[0] = &run.pressure[0];
  in.pressure[1] = &run.pressure[1];
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
  if (angle) undo_angle_readings(model, run, in);
  if (skew != 0) {
    const double shift = skew / dt;
    const std::vector<double> angle_at = *in.angle, velocity_at = *in.velocity,
                              acceleration_at = *in.acceleration, dry_at = *in.dry;
    in.own_angle.resize(angle_at.size());
    in.own_velocity.resize(angle_at.size());
    in.own_acceleration.resize(angle_at.size());
    in.own_dry.resize(angle_at.size());
    for (std::size_t k = 0; k < angle_at.size(); ++k) {
      const double at = static_cast<double>(k) + shift;
      in.own_angle[k] = between(angle_at, velocity_at, at, dt);
      in.own_velocity[k] = between(velocity_at, acceleration_at, at, dt);
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
  }
  for (const Active& a : model.effects) {
    if (!run.has_pressure) break;
    const auto& info = a.hypothesis->info();
    const bool reading = a.hypothesis->reads_pressure;
    if ((!reading && info.hook != Hook::kMusclePressure) || is_null(a)) continue;
    const int e = a.hypothesis->effect;
    for (int i = 0; i < 2; ++i)
      if (in.own_pressure[i].empty()) in.own_pressure[i] = *in.pressure[i];
    for (std::size_t k = 0; k < in.own_pressure[0].size(); ++k) {
      double p[2] = {in.own_pressure[0][k], in.own_pressure[1][k]};
      if (reading) {
        double truth[2] = {p[0], p[1]};
        for (int round = 0; round < kInversions; ++round) {
          models::Readings<double> y;
          y.pressure[0] = truth[0];
          y.pressure[1] = truth[1];
          models::effect_reading(e, a.values.data(), time_of(*a.hypothesis, run, k),
                                 static_cast<const double*>(nullptr), y);
          for (int i = 0; i < 2; ++i) truth[i] = p[i] - (y.pressure[i] - truth[i]);
        }
        p[0] = truth[0];
        p[1] = truth[1];
      } else {
        models::effect_muscle_pressure(e, a.values.data(), p);
      }
      in.own_pressure[0][k] = p[0];
      in.own_pressure[1][k] = p[1];
    }
    in.pressure[0] = &in.own_pressure[0];
    in.pressure[1] = &in.own_pressure[1];
  }
  add_columns(index, in);
  return shared;
}

/// The terms of the baseline at the rows of the torque chain, one after another, for unit parameters.
void Predictor::add_columns(std::size_t index, Inputs& in) const {
  const double one = 1;
  in.columns.clear();
  for (std::size_t i = data_->run_begin[index]; i < data_->run_begin[index + 1]; ++i) {
    if (data_->rows[i].chain != Chain::kTorque) continue;
    const JointPoint<double> x = point_at(data_->rig, 0, 0, *in.angle, *in.velocity, *in.acceleration,
                                          in.pressure, 0, data_->rows[i].sample);
    for (std::size_t j = 0; j < terms_.size(); ++j)
      in.columns.push_back(term_sign_[j] * models::effect_torque(terms_[j], &one, x));
  }
}

double Predictor::base_torque(const ModelPoint& model, const Inputs& in, std::size_t k) const {
  const JointPoint<double> x =
      point_at(data_->rig, 0, 0, *in.angle, *in.velocity, *in.acceleration, in.pressure, 0, k);
  double torque = 0;
  for (std::size_t j = 0; j < terms_.size(); ++j)
    torque += term_sign_[j] * models::effect_torque(terms_[j], &model.base[j], x);
  return torque;
}

std::vector<double> Predictor::torque_of_effects(const ModelPoint& model, const PreparedRun& run,
                                                 const Inputs& in, bool motion) const {
  const bool seed = data_->baseline.terms.empty();
  std::vector<double> sum;
  for (const Active& a : model.effects) {
    const Hypothesis& h = *a.hypothesis;
    if (h.info().hook != Hook::kTorque) continue;
    if (seed && (h.seen_by == SeenBy::kMotionOnly) != motion) continue;
    if (is_null(a)) continue;
    if (sum.empty()) sum.assign(run.time.size(), 0.0);
    const double sign = data_->baseline.driven ? -1.0 : 1.0;
    const double stiffness = stiffness_ >= 0 ? model.base[static_cast<std::size_t>(stiffness_)] : 0.0;
    const double gain = pressure_gain_ >= 0 ? model.base[static_cast<std::size_t>(pressure_gain_)] : 0.0;
    const std::vector<double>& velocity = h.dry ? *in.dry : *in.velocity;
    const std::vector<double>& acceleration = motion ? *in.slow_acceleration : *in.acceleration;
    const auto at = [&](std::size_t k) {
      return point_at(data_->rig, stiffness, gain, *in.angle, velocity, acceleration, in.pressure,
                      time_of(h, run, k), k);
    };
    JointPoint<double> x = at(0);
    if (h.info().state_count == 0) {
      for (std::size_t k = 0; k < sum.size(); ++k)
        sum[k] += sign * models::effect_torque(h.effect, a.values.data(), at(k));
      continue;
    }
    Memory memory(a);
    memory.rest(x);
    for (std::size_t k = 0; k < sum.size(); ++k) {
      const JointPoint<double> next = k == 0 ? x : at(k);
      if (k > 0) memory.step(x, next, run.interval);
      x = next;
      sum[k] += sign * models::effect_torque(h.effect, a.values.data(), x, memory.state());
    }
  }
  return sum;
}

/// What sensors of the force make of a torque: added to `change`. The forces are half of the torque on either side of their
/// measured sum, whose noise is not that of the torque; where a reading is clipped, what the other sensor leaves for it.
void Predictor::read_forces(const ModelPoint& model, const PreparedRun& run,
                            const std::vector<double>& torque, std::vector<double>& change) const {
  if (run.force[0].empty()) return;
  const double r = data_->rig.wheel_radius;
  for (const Active& a : model.effects) {
    const Hypothesis& h = *a.hypothesis;
    if (!h.reads_force || is_null(a)) continue;
    double z[models::kMaxEffectStates] = {};
    const bool memory = h.info().state_count > 0, clips = !h.amplitude[0];
    double last[2] = {0, 0};
    for (std::size_t k = 0; k < torque.size(); ++k) {
      models::Readings<double> y;
      const double load = (torque[k] + change[k]) / r;
      if (clips) {
        y.force[0] = run.force[1][k] - load;
        y.force[1] = run.force[0][k] + load;
      } else {
        const double common = memory ? 0.0 : 0.5 * (run.force[0][k] + run.force[1][k]);
        y.force[0] = common - 0.5 * load;
        y.force[1] = common + 0.5 * load;
      }
      const double before[2] = {y.force[0], y.force[1]};
      if (memory) {
        if (k == 0) {
          models::effect_reading_rest(h.effect, a.values.data(), y, z);
        } else {
          // First-order in its state: exponential step on the mean input of the sample.
          models::Readings<double> middle = y;
          for (int i = 0; i < 2; ++i) middle.force[i] = 0.5 * (last[i] + before[i]);
          double f[2] = {}, g[2] = {}, nudged[2] = {z[0] + 1e-6, z[1] + 1e-6};
          models::effect_reading_derivative(h.effect, a.values.data(), middle, z, f);
          models::effect_reading_derivative(h.effect, a.values.data(), middle, nudged, g);
          for (int i = 0; i < 2; ++i) {
            const double slope = (g[i] - f[i]) / 1e-6 * run.interval;
            z[i] += run.interval * f[i] * growth(slope);
          }
        }
        last[0] = before[0];
        last[1] = before[1];
      }
      models::effect_reading(h.effect, a.values.data(), time_of(h, run, k), memory ? z : nullptr, y);
      change[k] += r * ((y.force[1] - before[1]) - (y.force[0] - before[0]));
    }
  }
}

void Predictor::pressures_of(const ModelPoint& model, const PreparedRun& run, const Inputs& in,
                             std::vector<double> (&p)[2]) const {
  const std::size_t n = run.time.size();
  const double dt = run.interval;
  const double gain = model.base[static_cast<std::size_t>(gain_)],
               lag = model.base[static_cast<std::size_t>(lag_)];
  struct Placed {
    const Active* active;
    double z[models::kMaxEffectStates];
  };
  std::vector<Placed> effects;
  double delay = 0;
  for (const Active& a : model.effects) {
    const auto& info = a.hypothesis->info();
    if (info.hook == Hook::kDelay && info.where == Subsystem::kPcu) {
      delay += models::effect_delay(a.hypothesis->effect, a.values.data());
    } else if (info.hook == Hook::kCommand || info.hook == Hook::kPressureRate) {
      effects.push_back({&a, {}});
    }
  }
  const double shift = delay / dt, whole = std::floor(shift), part = shift - whole;
  const auto command = [&](int i, std::size_t k) {
    const auto at = static_cast<std::ptrdiff_t>(k) - static_cast<std::ptrdiff_t>(whole);
    const auto last = static_cast<std::ptrdiff_t>(n) - 1;
    const auto& u = run.command[i];
    return (1 - part) * u[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(at, 0, last))] +
           part * u[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(at - 1, 0, last))];
  };
  models::ValvePoint<double> x;
  x.lag = lag;
  const auto rates = [&](const double(&u0)[2], const double(&state)[2], double velocity, double(&v)[2],
                         double move) {
    double u[2] = {gain * u0[0], gain * u0[1]};
    x.pressure[0] = state[0];
    x.pressure[1] = state[1];
    x.velocity = velocity;
    for (Placed& e : effects) {
      x.command[0] = u[0];
      x.command[1] = u[1];
      models::effect_command(e.active->hypothesis->effect, e.active->values.data(), x, e.z, u);
    }
    for (int i = 0; i < 2; ++i) v[i] = (u[i] - state[i]) / lag;
    for (const Placed& e : effects)
      models::effect_pressure_rate(e.active->hypothesis->effect, e.active->values.data(), x, e.z, v);
    if (!(move > 0)) return;
    double again[2] = {gain * u0[0], gain * u0[1]};
    for (Placed& e : effects) {
      x.command[0] = again[0];
      x.command[1] = again[1];
      double f[2] = {}, g[2] = {};
      const int effect = e.active->hypothesis->effect;
      const double* q = e.active->values.data();
      const int count = e.active->hypothesis->info().state_count;
      if (count > 0) {
        constexpr double kNudge = 1.0;  // Pa
        double nudged[2] = {e.z[0] + kNudge, e.z[1] + kNudge};
        models::effect_valve_derivative(effect, q, x, u, v, e.z, f);
        models::effect_valve_derivative(effect, q, x, u, v, nudged, g);
        models::effect_command(effect, q, x, e.z, again);
        for (int i = 0; i < count; ++i) {
          const double slope = (g[i] - f[i]) / kNudge * move;
          e.z[i] += move * f[i] * growth(slope);
        }
      } else {
        models::effect_command(effect, q, x, e.z, again);
      }
    }
  };
  p[0].resize(n);
  p[1].resize(n);
  double state[2] = {(*in.pressure[0])[0], (*in.pressure[1])[0]};
  {
    const double u0[2] = {command(0, 0), command(1, 0)};
    double u[2] = {gain * u0[0], gain * u0[1]};
    for (int i = 0; i < 2; ++i) x.pressure[i] = state[i];
    for (Placed& e : effects) {
      x.command[0] = u[0];
      x.command[1] = u[1];
      models::effect_valve_rest(e.active->hypothesis->effect, e.active->values.data(), x, e.z);
      models::effect_command(e.active->hypothesis->effect, e.active->values.data(), x, e.z, u);
    }
  }
  const bool moves = !run.velocity.empty();
  const bool with_states = std::any_of(effects.begin(), effects.end(), [](const Placed& e) {
    return e.active->hypothesis->info().state_count > 0 &&
           e.active->hypothesis->info().id != std::string_view("valve_hysteresis");
  });
  const int substeps = with_states ? 4 : 1;
  if (effects.empty()) {
    // The same steps for the first-order lag alone, bit for bit.
    for (std::size_t k = 0; k < n; ++k)
      for (int i = 0; i < 2; ++i) {
        p[i][k] = state[i];
        const double u = gain * command(i, k), middle = state[i] + 0.5 * dt * ((u - state[i]) / lag);
        state[i] += dt * ((u - middle) / lag);
      }
    return;
  }
  for (std::size_t k = 0; k < n; ++k) {
    p[0][k] = state[0];
    p[1][k] = state[1];
    if (k + 1 == n) break;
    const double u[2] = {command(0, k), command(1, k)};
    {
      // States that only step (play) see the command as the effects before them leave it.
      double chain[2] = {gain * u[0], gain * u[1]};
      x.pressure[0] = state[0];
      x.pressure[1] = state[1];
      for (Placed& e : effects) {
        x.command[0] = chain[0];
        x.command[1] = chain[1];
        models::effect_valve_step(e.active->hypothesis->effect, e.active->values.data(), x, e.z);
        models::effect_command(e.active->hypothesis->effect, e.active->values.data(), x, e.z, chain);
      }
    }
    const double w = moves ? 0.5 * ((*in.velocity)[k] + (*in.velocity)[k + 1]) : 0.0;
    // Midpoint rule; states move by half a step before its second half.
    const double h = dt / substeps;
    for (int sub = 0; sub < substeps; ++sub) {
      double v[2], middle[2];
      rates(u, state, w, v, with_states ? 0.5 * h : 0.0);
      for (int i = 0; i < 2; ++i) middle[i] = state[i] + 0.5 * h * v[i];
      rates(u, middle, w, v, with_states ? 0.5 * h : 0.0);
      for (int i = 0; i < 2; ++i) state[i] += h * v[i];
    }
  }
}

namespace {

/// Changes by pressure sensors on a predicted pressure.
void read_pressures(const ModelPoint& model, const PreparedRun& run, std::vector<double> (&p)[2]) {
  for (const Active& a : model.effects) {
    const Hypothesis& h = *a.hypothesis;
    if (!h.reads_pressure || is_null(a)) continue;
    for (std::size_t k = 0; k < p[0].size(); ++k) {
      models::Readings<double> y;
      y.pressure[0] = p[0][k];
      y.pressure[1] = p[1][k];
      models::effect_reading(h.effect, a.values.data(), time_of(h, run, k),
                             static_cast<const double*>(nullptr), y);
      p[0][k] = y.pressure[0];
      p[1][k] = y.pressure[1];
    }
  }
}

/// g ∗ x at one sample.
class Kernel {
 public:
  explicit Kernel(double sigma) : weights_(gaussian(std::max(sigma, 0.3), 0)) {}
  double operator()(const std::vector<double>& x, std::size_t k) const { return centred_sum(weights_, x, k); }

 private:
  std::vector<double> weights_;
};

bool reads_force(const ModelPoint& model) {
  return std::any_of(model.effects.begin(), model.effects.end(),
                     [](const Active& a) { return a.hypothesis->reads_force && !is_null(a); });
}

}  // namespace

void Predictor::predict_run(const ModelPoint& model, std::size_t index, unsigned chains,
                            Eigen::VectorXd& out) const {
  const PreparedRun& run = data_->runs[index];
  const std::size_t begin = data_->run_begin[index], end = data_->run_begin[index + 1];
  if (begin == end) return;
  const std::shared_ptr<const Inputs> kept = inputs_of(model, index);
  const Inputs& in = *kept;
  const auto for_rows = [&](Chain chain, auto&& value) {
    for (std::size_t i = begin; i < end; ++i)
      if (data_->rows[i].chain == chain) out[static_cast<Eigen::Index>(i)] = value(data_->rows[i].sample);
  };
  if ((chains & bit(Chain::kTorque)) != 0 && run.has_torque) {
    std::vector<double> extra = torque_of_effects(model, run, in, false);
    if (reads_force(model)) {
      std::vector<double> torque(run.time.size());
      for (std::size_t k = 0; k < torque.size(); ++k)
        torque[k] = base_torque(model, in, k) + (extra.empty() ? 0.0 : extra[k]);
      std::vector<double> change(torque.size(), 0.0);
      read_forces(model, run, torque, change);
      if (extra.empty()) {
        extra = std::move(change);
      } else {
        for (std::size_t k = 0; k < change.size(); ++k) extra[k] += change[k];
      }
    }
    const double* column = in.columns.data();
    const double resting = model.rest.empty() ? 0.0 : model.rest[index] * stiffness(model);
    const auto base = [&] {
      double sum = resting;
      for (std::size_t j = 0; j < terms_.size(); ++j) sum += model.base[j] * *column++;
      return sum;
    };
    if (extra.empty()) {
      for_rows(Chain::kTorque, [&](std::size_t) { return base(); });
    } else {
      const Kernel kernel(data_->smoothing.torque / run.interval);
      for_rows(Chain::kTorque, [&](std::size_t k) { return base() + kernel(extra, k); });
    }
  }
  if ((chains & bit(Chain::kMotion)) != 0 && run.is_free && !run.slow_acceleration.empty()) {
    std::vector<double> extra = torque_of_effects(model, run, in, true);
    for (double& v : extra) v = -v;
    const double inertia = data_->rig.inertia;
    if (reads_force(model)) {
      std::vector<double> torque(run.time.size());
      for (std::size_t k = 0; k < torque.size(); ++k)
        torque[k] = inertia * (*in.slow_acceleration)[k] + (extra.empty() ? 0.0 : extra[k]);
      std::vector<double> change(torque.size(), 0.0);
      read_forces(model, run, torque, change);
      if (extra.empty()) {
        extra = std::move(change);
      } else {
        for (std::size_t k = 0; k < change.size(); ++k) extra[k] += change[k];
      }
    }
    const Kernel kernel(data_->smoothing.motion / run.interval);
    for_rows(Chain::kMotion, [&](std::size_t k) {
      return inertia * (*in.slow_acceleration)[k] + (extra.empty() ? 0.0 : kernel(extra, k));
    });
  }
  if ((chains & kPressureChains) != 0 && run.has_command && gain_ >= 0) {
    std::vector<double> p[2];
    pressures_of(model, run, in, p);
    read_pressures(model, run, p);
    const Kernel kernel(data_->smoothing.torque / run.interval);
    for_rows(Chain::kPressure1, [&](std::size_t k) { return kernel(p[0], k); });
    for_rows(Chain::kPressure2, [&](std::size_t k) { return kernel(p[1], k); });
  }
}

bool Predictor::adds_up(const ModelPoint& model, const Hypothesis& effect) const noexcept {
  return effect.info().hook == Hook::kTorque && !reads_force(model);
}

void Predictor::predict_addition(const ModelPoint& model, const Active& effect, Eigen::VectorXd& out) const {
  ModelPoint alone = model;
  alone.effects = {effect};
  for (std::size_t r = 0; r < data_->runs.size(); ++r) {
    const PreparedRun& run = data_->runs[r];
    const std::size_t begin = data_->run_begin[r], end = data_->run_begin[r + 1];
    if (begin == end) continue;
    const std::shared_ptr<const Inputs> in = inputs_of(model, r);
    for (const Chain chain : {Chain::kTorque, Chain::kMotion}) {
      const bool motion = chain == Chain::kMotion;
      if ((effect.hypothesis->chains & bit(chain)) == 0) continue;
      if (motion ? !run.is_free || run.slow_acceleration.empty() : !run.has_torque) continue;
      const std::vector<double> torque = torque_of_effects(alone, run, *in, motion);
      if (torque.empty()) continue;
      const double sign = motion ? -1.0 : 1.0;
      const Kernel kernel((motion ? data_->smoothing.motion : data_->smoothing.torque) / run.interval);
      for (std::size_t i = begin; i < end; ++i)
        if (data_->rows[i].chain == chain)
          out[static_cast<Eigen::Index>(i)] = sign * kernel(torque, data_->rows[i].sample);
    }
  }
}

double Predictor::stiffness(const ModelPoint& model) const noexcept {
  if (stiffness_ < 0) return 0;
  const double r = data_->rig.wheel_radius;
  return model.base[static_cast<std::size_t>(stiffness_)] * r * r;
}

void Predictor::predict(const ModelPoint& model, unsigned chains, Eigen::VectorXd& out) const {
  for (std::size_t r = 0; r < data_->runs.size(); ++r) predict_run(model, r, chains, out);
}

Predictor::FullRate Predictor::full_rate(const ModelPoint& model, std::size_t index) const {
  const PreparedRun& run = data_->runs[index];
  FullRate rate;
  const std::shared_ptr<const Inputs> kept = inputs_of(model, index);
  const Inputs& in = *kept;
  const bool reads = reads_force(model);
  if (run.has_torque && (run.has_pressure || !data_->baseline.terms.empty())) {
    const std::vector<double> extra = torque_of_effects(model, run, in, false);
    rate.torque.resize(run.time.size());
    const double resting = index < model.rest.size() ? model.rest[index] * stiffness(model) : 0.0;
    for (std::size_t k = 0; k < rate.torque.size(); ++k)
      rate.torque[k] = resting + base_torque(model, in, k) + (extra.empty() ? 0.0 : extra[k]);
    if (reads) {
      std::vector<double> change(rate.torque.size(), 0.0);
      read_forces(model, run, rate.torque, change);
      for (std::size_t k = 0; k < change.size(); ++k) rate.torque[k] += change[k];
    }
  }
  if (run.is_free && !run.slow_acceleration.empty() && std::isfinite(data_->rig.inertia)) {
    const std::vector<double> extra = torque_of_effects(model, run, in, true);
    rate.motion.resize(run.time.size());
    for (std::size_t k = 0; k < rate.motion.size(); ++k)
      rate.motion[k] = data_->rig.inertia * (*in.slow_acceleration)[k] - (extra.empty() ? 0.0 : extra[k]);
    if (reads) {
      std::vector<double> change(rate.motion.size(), 0.0);
      read_forces(model, run, rate.motion, change);
      for (std::size_t k = 0; k < change.size(); ++k) rate.motion[k] += change[k];
    }
  }
  if (run.has_command && gain_ >= 0) {
    pressures_of(model, run, in, rate.pressure);
    read_pressures(model, run, rate.pressure);
  }
  return rate;
}

}  // namespace isac::explain
