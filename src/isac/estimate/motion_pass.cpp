#include "isac/estimate/motion_pass.hpp"

#include <algorithm>
#include <cmath>

#include "isac/series/simd.hpp"

namespace isac::estimate::motion {
namespace {

#define ISAC_INLINE inline __attribute__((always_inline))

struct Constants {
  double stiffness, gain, cubic, viscous, friction, gravity, inverse_inertia, inverse_lag,
      inverse_friction_speed;
  double wheel, wheel2;
};

Constants constants_of(const MotionVector& p, const MotionOptions& options) {
  const double r = options.wheel_radius;
  return {.stiffness = p[kA] * r * r,
          .gain = p[kB] * r,
          .cubic = p[kC],
          .viscous = p[kD],
          .friction = p[kFriction],
          .gravity = options.gravity_torque,
          .inverse_inertia = 1.0 / p[kInertia],
          .inverse_lag = 1.0 / p[kLag],
          .inverse_friction_speed = 1.0 / options.friction_speed,
          .wheel = r,
          .wheel2 = r * r};
}

struct Point {
  double phi, omega, q;
};

struct Rates {
  double phi, omega, q;
  double tanh_value, sin_value;
};

ISAC_INLINE Rates rates(const Constants& k, const Point& x, double command) {
  Rates d;
  d.tanh_value = k.friction != 0 ? std::tanh(x.omega * k.inverse_friction_speed) : 0.0;
  d.sin_value = k.gravity != 0 ? std::sin(x.phi) : 0.0;
  d.phi = x.omega;
  d.omega = (k.gain * x.q + k.stiffness * x.phi - k.cubic * x.omega * x.omega * x.omega -
             k.viscous * x.omega - k.friction * d.tanh_value - k.gravity * d.sin_value) *
            k.inverse_inertia;
  d.q = (command - x.q) * k.inverse_lag;
  return d;
}

/// Sensitivities of `L` unknowns: eight are enough where the initial state is known, twelve where it is fitted.
template <int L>
struct Lanes {
  alignas(64) double phi[L], omega[L], q[L];
};

/// Rates of the sensitivities at a stage: F_x s + F_θ.
template <int L>
ISAC_INLINE void lane_rates(const Constants& k, const Point& x, const Rates& d, const Lanes<L>& s,
                            Lanes<L>& ds, double tanh_known) {
  const double cos_value = k.gravity != 0 ? std::cos(x.phi) : 0.0;
  const double a = (k.stiffness - k.gravity * cos_value) * k.inverse_inertia;
  const double b = -(3 * k.cubic * x.omega * x.omega + k.viscous +
                     k.friction * k.inverse_friction_speed * (1 - tanh_known * tanh_known)) *
                   k.inverse_inertia;
  const double c = k.gain * k.inverse_inertia;
  alignas(64) double force[L] = {
      -d.omega * k.inverse_inertia,      k.wheel2 * x.phi * k.inverse_inertia,
      k.wheel * x.q * k.inverse_inertia, -x.omega * x.omega * x.omega * k.inverse_inertia,
      -x.omega * k.inverse_inertia,      -tanh_known * k.inverse_inertia};
  for (int j = 0; j < L; ++j) ds.phi[j] = s.omega[j];
  for (int j = 0; j < L; ++j) ds.omega[j] = a * s.phi[j] + b * s.omega[j] + c * s.q[j] + force[j];
  for (int j = 0; j < L; ++j) ds.q[j] = -k.inverse_lag * s.q[j];
  ds.q[kLag] -= d.q * k.inverse_lag;
}

template <int L>
ISAC_INLINE void shifted(const Lanes<L>& s, const Lanes<L>& ds, double h, Lanes<L>& out) {
  for (int j = 0; j < L; ++j) out.phi[j] = s.phi[j] + h * ds.phi[j];
  for (int j = 0; j < L; ++j) out.omega[j] = s.omega[j] + h * ds.omega[j];
  for (int j = 0; j < L; ++j) out.q[j] = s.q[j] + h * ds.q[j];
}

ISAC_INLINE Point moved(const Point& x, const Rates& d, double h) {
  return {x.phi + h * d.phi, x.omega + h * d.omega, x.q + h * d.q};
}

ISAC_INLINE Point combined(const Point& x, const Rates& a, const Rates& b, const Rates& c, const Rates& d,
                           double h) {
  return {x.phi + h / 6 * (a.phi + 2 * (b.phi + c.phi) + d.phi),
          x.omega + h / 6 * (a.omega + 2 * (b.omega + c.omega) + d.omega),
          x.q + h / 6 * (a.q + 2 * (b.q + c.q) + d.q)};
}

ISAC_INLINE Point step(const Constants& k, const Point& x, double h, double u0, double u1) {
  const double middle = 0.5 * (u0 + u1);
  const Rates a = rates(k, x, u0);
  const Rates b = rates(k, moved(x, a, h / 2), middle);
  const Rates c = rates(k, moved(x, b, h / 2), middle);
  const Rates d = rates(k, moved(x, c, h), u1);
  return combined(x, a, b, c, d, h);
}

/// State and sensitivities one step on.
template <int L>
ISAC_INLINE Point step_with_lanes(const Constants& k, const Point& x, Lanes<L>& s, double h, double u0,
                                  double u1) {
  const double middle = 0.5 * (u0 + u1);
  // tanh is needed even where T_c is zero now: its column −tanh/I is what could lift it from zero.
  const auto tanh_at = [&k](const Point& y, const Rates& d) {
    return k.friction != 0 ? d.tanh_value : std::tanh(y.omega * k.inverse_friction_speed);
  };
  Lanes<L> da, db, dc, dd, t;
  const Rates a = rates(k, x, u0);
  lane_rates(k, x, a, s, da, tanh_at(x, a));
  const Point xb = moved(x, a, h / 2);
  const Rates b = rates(k, xb, middle);
  shifted(s, da, h / 2, t);
  lane_rates(k, xb, b, t, db, tanh_at(xb, b));
  const Point xc = moved(x, b, h / 2);
  const Rates c = rates(k, xc, middle);
  shifted(s, db, h / 2, t);
  lane_rates(k, xc, c, t, dc, tanh_at(xc, c));
  const Point xd = moved(x, c, h);
  const Rates d = rates(k, xd, u1);
  shifted(s, dc, h, t);
  lane_rates(k, xd, d, t, dd, tanh_at(xd, d));
  const double w = h / 6;
  for (int j = 0; j < L; ++j) s.phi[j] += w * (da.phi[j] + 2 * (db.phi[j] + dc.phi[j]) + dd.phi[j]);
  for (int j = 0; j < L; ++j) s.omega[j] += w * (da.omega[j] + 2 * (db.omega[j] + dc.omega[j]) + dd.omega[j]);
  for (int j = 0; j < L; ++j) s.q[j] += w * (da.q[j] + 2 * (db.q[j] + dc.q[j]) + dd.q[j]);
  return combined(x, a, b, c, d, h);
}

ISAC_INLINE bool sane(const Point& x) {
  return std::abs(x.phi) < 1e6 && std::abs(x.omega) < 1e9;
}

ISAC_SIMD bool predict_rows(const Prepared& run, const Constants& k, Point x, double* angles) {
  const std::size_t n = run.time.size();
  for (std::size_t i = 0; i < n; ++i) {
    angles[i] = x.phi;
    if (i + 1 == n) break;
    const int pieces = run.substeps[i];
    const double h = (run.time[i + 1] - run.time[i]) / pieces;
    const double from = run.command_from[i], slope = (run.command_to[i] - from) / pieces;
    for (int piece = 0; piece < pieces; ++piece) {
      x = step(k, x, h, from + piece * slope, from + (piece + 1) * slope);
    }
    if (!sane(x)) return false;
  }
  return true;
}

template <int L>
ISAC_INLINE bool accumulate_lanes(const Prepared& run, const Constants& k, Point x, std::size_t block_rows,
                                  std::vector<Sums>& blocks) {
  Lanes<L> s = {};
  if constexpr (L > kInitialSpeed) {
    s.phi[kInitialAngle] = 1;
    s.omega[kInitialSpeed] = 1;
  }
  const std::size_t n = run.time.size();
  Sums* sums = nullptr;
  for (std::size_t i = 0; i < n; ++i) {
    if (sums == nullptr || sums->rows == block_rows) sums = &blocks.emplace_back();
    const double e = run.angle[i] - x.phi;
    sums->square += e * e;
    ++sums->rows;
    for (int row = 0; row < L; ++row) {
      const double weight = s.phi[row];
      for (int j = 0; j < L; ++j) sums->gram[row][j] += weight * s.phi[j];
    }
    for (int j = 0; j < L; ++j) sums->moment[j] += e * s.phi[j];
    if (i + 1 == n) break;
    const int pieces = run.substeps[i];
    const double h = (run.time[i + 1] - run.time[i]) / pieces;
    const double from = run.command_from[i], slope = (run.command_to[i] - from) / pieces;
    for (int piece = 0; piece < pieces; ++piece) {
      x = step_with_lanes(k, x, s, h, from + piece * slope, from + (piece + 1) * slope);
    }
    if (!sane(x)) return false;
  }
  return true;
}

ISAC_SIMD bool accumulate_parameters(const Prepared& run, const Constants& k, Point x, std::size_t block_rows,
                                     std::vector<Sums>& blocks) {
  return accumulate_lanes<8>(run, k, x, block_rows, blocks);
}

ISAC_SIMD bool accumulate_all(const Prepared& run, const Constants& k, Point x, std::size_t block_rows,
                              std::vector<Sums>& blocks) {
  return accumulate_lanes<kLanes>(run, k, x, block_rows, blocks);
}

}  // namespace

namespace {

/// Reads a sampled command at increasing times.
class CommandReader {
 public:
  CommandReader(const std::vector<double>& times, const std::vector<double>& values)
      : times_(times), values_(values) {}

  double linear_at(double time) {
    seek(time);
    if (time <= times_[at_] || at_ + 1 == times_.size()) return values_[at_];
    const double part = (time - times_[at_]) / (times_[at_ + 1] - times_[at_]);
    return values_[at_] + part * (values_[at_ + 1] - values_[at_]);
  }

  /// Mean over [begin, end] of the command that holds between its samples: exact where L is no multiple of the interval.
  double held_mean(double begin, double end) {
    seek(begin);
    if (!(end > begin)) return values_[at_];
    double sum = 0, from = begin;
    for (std::size_t k = at_; from < end; ++k) {
      const double until = k + 1 < times_.size() ? std::min(times_[k + 1], end) : end;
      sum += values_[k] * (until - from);
      from = until;
      if (k + 1 == times_.size()) break;
    }
    return sum / (end - begin);
  }

 private:
  void seek(double time) {
    while (at_ > 0 && times_[at_] > time) --at_;
    while (at_ + 1 < times_.size() && times_[at_ + 1] <= time) ++at_;
  }

  const std::vector<double>& times_;
  const std::vector<double>& values_;
  std::size_t at_ = 0;
};

}  // namespace

Prepared prepare(const MotionRun& run, const MotionOptions& options) {
  Prepared ready;
  for (std::size_t i = 0; i < run.time.size(); ++i) {
    if (!std::isfinite(run.time[i]) || !std::isfinite(run.angle[i])) continue;
    ready.time.push_back(run.time[i]);
    ready.angle.push_back(run.angle[i]);
    ready.source_row.push_back(i);
  }
  // The command at t − L; missing samples are bridged, the ends held.
  std::vector<double> times, values;
  for (std::size_t i = 0; i < run.time.size(); ++i) {
    if (!std::isfinite(run.time[i]) || !std::isfinite(run.command[i])) continue;
    times.push_back(run.time[i]);
    values.push_back(run.command[i]);
  }
  if (times.empty()) return {};
  CommandReader reader(times, values);
  for (std::size_t i = 0; i < ready.time.size(); ++i) {
    const double begin = ready.time[i] - options.dead_time;
    const double end = (i + 1 < ready.time.size() ? ready.time[i + 1] : ready.time[i]) - options.dead_time;
    if (options.command_linear) {
      ready.command_from.push_back(reader.linear_at(begin));
      ready.command_to.push_back(reader.linear_at(end));
    } else {
      const double mean = reader.held_mean(begin, end);
      ready.command_from.push_back(mean);
      ready.command_to.push_back(mean);
    }
  }
  for (std::size_t i = 0; i + 1 < ready.time.size(); ++i) {
    const double pieces = std::ceil((ready.time[i + 1] - ready.time[i]) / options.max_step - 1e-9);
    ready.substeps.push_back(static_cast<int>(std::clamp(pieces, 1.0, 1e6)));
  }
  return ready;
}

bool predict(const Prepared& run, const State& state, const MotionOptions& options, double* angles) {
  const double q = options.initial_rest ? 0.0 : run.command_from.front();
  return predict_rows(run, constants_of(state.parameters, options), {state.angle, state.speed, q}, angles);
}

bool accumulate(const Prepared& run, const State& state, const MotionOptions& options, std::size_t block_rows,
                std::vector<Sums>& blocks) {
  const double q = options.initial_rest ? 0.0 : run.command_from.front();
  const Constants constants = constants_of(state.parameters, options);
  const Point start{state.angle, state.speed, q};
  const std::size_t rows = block_rows == 0 ? run.time.size() + 1 : block_rows;
  return options.initial_rest ? accumulate_parameters(run, constants, start, rows, blocks)
                              : accumulate_all(run, constants, start, rows, blocks);
}

}  // namespace isac::estimate::motion
