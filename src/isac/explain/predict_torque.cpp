// The torque of effects along the measured motion, and what sensors of the force make of it.
#include <algorithm>
#include <cmath>
#include <complex>
#include <span>

#include "isac/core/units.hpp"
#include "isac/explain/predict_parts.hpp"

namespace isac::explain {
namespace {

using models::Hook;
using models::JointPoint;

constexpr double kEdge = 5;          // standard deviations of the kernel that a run's first row reaches into
constexpr double kRing = 1.5;        // s, of the beginning
constexpr double kAtStart = 0.05;    // rad: what hangs on a compliance may be this far off at the beginning
constexpr double kAtRest = 0.001;    // rad, where the joint was at rest then
constexpr double kRingNoise = 0.02;  // N m, of a sample

/// dz/dt along a path of inputs that is smooth within a sample, by an exponential Rosenbrock–Euler step (exact where the
/// equation is linear in its state, as Dahl's and the creep's are between reversals) for one state, by RK4 for two.
/// `Effect`: models::TorqueEffect<E>.
template <class Effect>
class Memory {
 public:
  Memory(const Active& active)
      : q_(active.values.data()),
        dry_(active.hypothesis->dry),
        plays_(active.hypothesis->id() == "backlash") {}
  void rest(const JointPoint<double>& x) { Effect::rest(q_, x, z_); }
  double torque(const JointPoint<double>& x) const { return torque(q_, x); }
  /// With other amplitudes, which the states owe nothing to.
  double torque(const double* q, const JointPoint<double>& x) const { return Effect::torque(q, x, z_); }
  /// Inlined: then only what the effect's equation asks of a point is read.
  [[gnu::always_inline]] void step(const JointPoint<double>& from, const JointPoint<double>& to, double dt) {
    JointPoint<double> middle = to;
    middle.angle = 0.5 * (from.angle + to.angle);
    middle.velocity = 0.5 * (from.velocity + to.velocity);
    if (plays_) {  // a rate that is on or off would run past the play's end by up to a sample's motion
      z_[0] = std::clamp(z_[0], to.angle - q_[0], to.angle + q_[0]);
      return;
    }
    if constexpr (Effect::kInfo.state_count == 1) {
      const double first = rate(middle, z_[0]);
      if (first == 0) return;
      // A state that slips at its limit must not run past it within a sample.
      constexpr double kLongestMove = 0.03;
      int parts = 1;
      if (dry_ && std::abs(first) * dt >= 2 * kLongestMove)
        parts = std::clamp(static_cast<int>(std::abs(first) * dt / kLongestMove), 1, 16);
      const double h = parts == 1 ? dt : dt / parts;
      for (int part = 0; part < parts; ++part) {
        const double f = part == 0 ? first : rate(middle, z_[0]);
        z_[0] += h * f * growth(std::min(slope(middle, f) * h, 5.0));
      }
    } else {
      double k1[2], k2[2], k3[2], k4[2], y[2];
      Effect::derivative(q_, from, z_, k1);
      for (int i = 0; i < 2; ++i) y[i] = z_[i] + 0.5 * dt * k1[i];
      Effect::derivative(q_, middle, y, k2);
      for (int i = 0; i < 2; ++i) y[i] = z_[i] + 0.5 * dt * k2[i];
      Effect::derivative(q_, middle, y, k3);
      for (int i = 0; i < 2; ++i) y[i] = z_[i] + dt * k3[i];
      Effect::derivative(q_, to, y, k4);
      for (int i = 0; i < 2; ++i) z_[i] += dt / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
    }
  }

 private:
  double rate(const JointPoint<double>& x, double z) const {
    double dz = 0;
    Effect::derivative(q_, x, &z, &dz);
    return dz;
  }
  /// ∂(dz/dt)/∂z, where the rate is `here`. Of a line by its ends: a step then need not wait for the one before to reckon it.
  double slope(const JointPoint<double>& x, double here) const {
    if constexpr (Effect::kInfo.linear_in_state) {
      return rate(x, 1) - rate(x, 0);
    } else {
      constexpr double kNudge = 1e-6;
      return (rate(x, z_[0] + kNudge) - here) / kNudge;
    }
  }
  const double* q_;
  bool dry_, plays_;
  double z_[models::kMaxEffectStates] = {};
};

/// Calls `use(k, memory, x)` at the points x = at(k), k < count, with the states as they are there, from rest at the first.
template <class PointAt, class Use>
void follow_memory(const Active& active, const PointAt& at, double interval, std::size_t count, Use&& use) {
  models::visit_torque_memory(active.hypothesis->effect, [&](auto effect) {
    Memory<decltype(effect)> memory(active);
    JointPoint<double> x = at(0);
    memory.rest(x);
    for (std::size_t k = 0; k < count; ++k) {
      const JointPoint<double> next = k == 0 ? x : at(k);
      if (k > 0) memory.step(x, next, interval);
      x = next;
      use(k, memory, x);
    }
  });
}

/// What swings on a free joint, from the kernel's reach before the recording on, where the joint rests.
void add_swing(const Active& active, const Motion& joint, double interval, double sign,
               std::vector<double>& sum) {
  const auto at = [&](std::size_t k) {
    JointPoint<double> x;
    x.angle = joint.angle[k];
    x.velocity = joint.velocity[k];
    x.acceleration = joint.acceleration[k];
    return x;
  };
  follow_memory(active, at, interval, joint.angle.size(),
                [&](std::size_t k, const auto& memory, const auto& x) {
                  if (k >= joint.lead) sum[k - joint.lead] += sign * memory.torque(x);
                });
}

/// Where what hangs on a compliance stood when a recording began is not known, and it rings from there: c e^{λt}, λ = W (−d ± i √(1 − d²)),
/// is fitted to what is left of the motion in the run's first moments, and added: within `off_by` rad. (Parameters: J2, f, d.)
void add_ring(const PreparedRun& run, const Values& q, double inertia, double sigma,
              const std::vector<double>& acceleration, double off_by, double sign,
              std::vector<double>& extra) {
  if (!run.recorded || run.smooth_torque.empty() || !(q[2] < 0.99) || !(q[0] > 0)) return;
  using Complex = std::complex<double>;
  const double w = 2 * kPi * q[1];
  const Complex root = w * Complex(-q[2], std::sqrt(1 - q[2] * q[2]));
  const Complex smoothed = std::exp(0.5 * root * root * sigma * sigma);  // what the kernel leaves of it
  const auto from = static_cast<std::size_t>(kEdge * sigma / run.interval);
  const auto to = std::min(extra.size(), from + static_cast<std::size_t>(kRing / run.interval));
  double rr = 0, ri = 0, ii = 0, re = 0, ie = 0;
  for (std::size_t k = from; k < to; ++k) {
    if (run.usable[k] == 0) continue;
    const double off = inertia * acceleration[k] - sign * extra[k] - run.smooth_torque[k];
    const Complex ring = smoothed * std::exp(root * (run.interval * static_cast<double>(k)));
    rr += ring.real() * ring.real();
    ri += ring.real() * ring.imag();
    ii += ring.imag() * ring.imag();
    re += ring.real() * off;
    ie += ring.imag() * off;
  }
  // Known beforehand to be small, and nothing where there is no second inertia.
  const double most = q[0] * w * w * off_by, ridge = kRingNoise * kRingNoise / (most * most);
  rr += ridge;
  ii += ridge;
  const double determinant = rr * ii - ri * ri;
  if (!(determinant > 0)) return;
  const double a = (ii * re - ri * ie) / determinant, b = (rr * ie - ri * re) / determinant;
  for (std::size_t k = 0; k < extra.size(); ++k) {
    const Complex ring = std::exp(root * (run.interval * static_cast<double>(k)));
    if (std::norm(ring) < 1e-12) break;
    extra[k] += sign * (a * ring.real() + b * ring.imag());
  }
}

}  // namespace

void Predictor::add_base_torque(const ModelPoint& model, const Inputs& in, std::vector<double>& sum) const {
  if (in.terms.empty()) {
    const double one = 1;
    in.terms.reserve(sum.size() * terms_.size());
    for (std::size_t k = 0; k < sum.size(); ++k) {
      const JointPoint<double> x =
          point_at(data_->rig, {}, *in.angle, *in.velocity, *in.acceleration, in.pressure, 0, k);
      for (std::size_t j = 0; j < terms_.size(); ++j)
        in.terms.push_back(term_sign_[j] * models::effect_torque(terms_[j], &one, x));
    }
  }
  const std::span<const double> output(model.base.data(), terms_.size());
  const double* term = in.terms.data();
  for (double& torque : sum)
    for (const double parameter : output) torque += parameter * *term++;
}

std::vector<double> Predictor::torque_of_effects(const ModelPoint& model, std::span<const Active> effects,
                                                 const PreparedRun& run, const Inputs& in,
                                                 bool motion) const {
  std::vector<double> sum;
  for (const Active& a : effects) {
    const Hypothesis& h = *a.hypothesis;
    if (!enters(h, motion) || is_null(a)) continue;
    if (sum.empty()) sum.assign(run.time.size(), 0.0);
    if (motion && has_fitted_states(h) && in.swing != nullptr) {
      const double sign = sign_of_torque();
      add_swing(a, *in.swing, run.interval, sign, sum);
      if (!a.as_known_beforehand)
        add_ring(run, a.values, data_->rig.inertia, data_->smoothing.torque, *in.acceleration,
                 in.swing->from_rest ? kAtRest : kAtStart, sign, sum);
      continue;
    }
    add_torque(model, a, run, in, sum);
  }
  return sum;
}

bool Predictor::enters(const Hypothesis& h, bool motion) const noexcept {
  return h.info().hook == Hook::kTorque &&
         (!data_->baseline.terms.empty() || (h.seen_by == SeenBy::kMotionOnly) == motion);
}

/// Where the effect's equation is evaluated, sample by sample of the recording.
auto Predictor::points_of(const ModelPoint& model, const Hypothesis& h, const PreparedRun& run,
                          const Inputs& in) const {
  const auto term = [&](int at) { return at >= 0 ? model.base[static_cast<std::size_t>(at)] : 0.0; };
  const BaselineOfPoint base{.stiffness = term(stiffness_),
                             .pressure_gain = term(pressure_gain_),
                             .cubic_damping = term(cubic_damping_),
                             .damping = term(damping_)};
  return [ base, &velocity = h.dry ? *in.dry : *in.velocity, &h, &run, &in, &rig = data_->rig ](std::size_t k)
      __attribute__((always_inline)) {
    return point_at(rig, base, *in.angle, velocity, *in.acceleration, in.pressure, time_of(h, run, k), k);
  };
}

void Predictor::add_torque(const ModelPoint& model, const Active& a, const PreparedRun& run, const Inputs& in,
                           std::vector<double>& sum) const {
  const auto at = points_of(model, *a.hypothesis, run, in);
  if (a.hypothesis->info().state_count == 0)
    models::add_effect_torques(a.hypothesis->effect, a.values.data(), at, sign_of_torque(), std::span(sum));
  else
    follow_memory(a, at, run.interval, sum.size(), [&](std::size_t k, const auto& memory, const auto& x) {
      sum[k] += sign_of_torque() * memory.torque(x);
    });
}

std::vector<std::vector<double>> Predictor::torques_of_amplitudes(const ModelPoint& model, const Active& a,
                                                                  const PreparedRun& run, const Inputs& in,
                                                                  std::size_t every) const {
  const Hypothesis& h = *a.hypothesis;
  const std::size_t count = (run.time.size() + every - 1) / every;
  std::vector<Values> ones;
  for (std::size_t i = 0; i < static_cast<std::size_t>(h.info().parameter_count); ++i) {
    if (!models::is_amplitude(h.info().parameters[i])) continue;
    ones.push_back(null_values(h, a.values));
    ones.back()[i] = 1;
  }
  std::vector<std::vector<double>> torques(ones.size(), std::vector<double>(count, 0.0));
  const auto at = points_of(model, h, run, in);
  if (h.info().state_count == 0) {
    std::vector<double*> sums;
    for (std::vector<double>& torque : torques) sums.push_back(torque.data());
    models::add_amplitude_torques(
        h.effect, a.values.data(), [&](std::size_t k) { return at(k * every); }, sign_of_torque(), count,
        std::span<double* const>(sums));
  } else {
    follow_memory(a, at, run.interval, count, [&](std::size_t k, const auto& memory, const auto& x) {
      for (std::size_t i = 0; i < ones.size(); ++i)
        torques[i][k] = sign_of_torque() * memory.torque(ones[i].data(), x);
    });
  }
  return torques;
}

double Predictor::change_at(const ModelPoint& model, const PreparedRun& run, std::size_t k,
                            double torque) const {
  if (run.force[0].empty()) return 0;
  const double r = data_->rig.wheel_radius;
  double change = 0;
  for (const Active& a : model.effects) {
    const Hypothesis& h = *a.hypothesis;
    if (!h.reads_force || is_null(a)) continue;
    const double half = 0.5 * (torque + change) / r;
    models::Readings<double> y;
    y.force[0] = run.common_force[k] - half;
    y.force[1] = run.common_force[k] + half;
    const double before = y.force[1] - y.force[0];
    models::effect_reading(h.effect, a.values.data(), time_of(h, run, k), static_cast<const double*>(nullptr),
                           y);
    change += r * ((y.force[1] - y.force[0]) - before);
  }
  return change;
}

/// What sensors of the force make of a torque: added to `change`. The forces are half of the torque on either side of their
/// measured sum, low-passed, whose noise is not that of the torque; where a reading is clipped, what the other sensor leaves for it.
void Predictor::read_forces(const ModelPoint& model, const PreparedRun& run, Reading which,
                            const std::vector<double>& torque, std::vector<double>& change) const {
  if (run.force[0].empty()) return;
  const double r = data_->rig.wheel_radius;
  for (const Active& a : model.effects) {
    const Hypothesis& h = *a.hypothesis;
    if (!h.reads_force || is_null(a)) continue;
    double z[models::kMaxEffectStates] = {};
    const bool memory = h.info().state_count > 0, clips = !h.amplitude[0];
    if (clips != (which == Reading::kClipped)) continue;
    constexpr double kNudge = 1.0;  // N
    double last[2] = {0, 0}, held[2] = {0, 0}, rising[2] = {0, 0};
    for (std::size_t k = 0; k < torque.size(); ++k) {
      models::Readings<double> y;
      const double load = (torque[k] + change[k]) / r;
      if (clips) {
        y.force[0] = run.force[1][k] - load;
        y.force[1] = run.force[0][k] + load;
      } else {
        const double common = memory ? 0.0 : run.common_force[k];
        y.force[0] = common - 0.5 * load;
        y.force[1] = common + 0.5 * load;
      }
      const double before[2] = {y.force[0], y.force[1]};
      if (memory) {
        if (k == 0) {
          models::effect_reading_rest(h.effect, a.values.data(), y, z);
        } else {
          // First-order in its state and its input: the step is exact for a force that is straight between samples. (On the
          // mean of the two no lag came out shorter than half a sample.)
          models::Readings<double> from = y;
          for (int i = 0; i < 2; ++i) from.force[i] = last[i];
          double first[2] = {}, then[2] = {};
          models::effect_reading_derivative(h.effect, a.values.data(), from, z, first);
          models::effect_reading_derivative(h.effect, a.values.data(), y, z, then);
          if (k == 1) {  // linear in its state: the slope is the same at every sample
            double moved[2] = {}, nudged[2] = {z[0] + kNudge, z[1] + kNudge};
            models::effect_reading_derivative(h.effect, a.values.data(), y, nudged, moved);
            for (int i = 0; i < 2; ++i) {
              const double slope = (moved[i] - then[i]) / kNudge * run.interval;
              held[i] = run.interval * growth(slope);
              rising[i] = run.interval * growth_of_ramp(slope);
            }
          }
          for (int i = 0; i < 2; ++i) z[i] += held[i] * first[i] + rising[i] * (then[i] - first[i]);
        }
        last[0] = before[0];
        last[1] = before[1];
      }
      models::effect_reading(h.effect, a.values.data(), time_of(h, run, k), memory ? z : nullptr, y);
      change[k] += r * ((y.force[1] - before[1]) - (y.force[0] - before[0]));
    }
  }
}

}  // namespace isac::explain
