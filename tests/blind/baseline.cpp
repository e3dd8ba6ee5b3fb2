#include "baseline.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "least_squares.hpp"

namespace blind {
namespace {

constexpr std::size_t kHalf = 25;  // rows, 50 ms

struct Powers {
  double pp = 0, pg = 0, gg = 0;
};

/// What unit lags of each T_C leave of the pressures, K_C being the best: pp − pg²/gg. Several in one pass, because each
/// is a chain of additions that waits for itself.
template <std::size_t kCount>
std::array<Powers, kCount> pressure_powers(const std::vector<RunPlan>& runs,
                                           const std::vector<Signals>& signals,
                                           const std::array<double, kCount>& T_C) {
  double share[kCount], pg[kCount] = {}, gg[kCount] = {}, g[kCount], pp = 0.0;
  for (std::size_t j = 0; j < kCount; ++j) share[j] = 1.0 - std::exp(-kRowTime / T_C[j]);
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (runs[i].heldout) continue;
    for (int valve = 0; valve < 2; ++valve) {
      const auto& u = valve == 0 ? runs[i].command_1 : runs[i].command_2;
      const auto& p = valve == 0 ? signals[i].p1 : signals[i].p2;
      std::fill(g, g + kCount, u.front());
      for (std::size_t k = 0; k < u.size(); ++k) {
        pp += p[k] * p[k];
        for (std::size_t j = 0; j < kCount; ++j) {
          pg[j] += p[k] * g[j];
          gg[j] += g[j] * g[j];
          g[j] += share[j] * (u[k] - g[j]);
        }
      }
    }
  }
  std::array<Powers, kCount> sums;
  for (std::size_t j = 0; j < kCount; ++j) sums[j] = {pp, pg[j], gg[j]};
  return sums;
}

void fit_valves(Baseline& base, const Rig& rig, const std::vector<RunPlan>& runs,
                const std::vector<Signals>& signals) {
  const auto left = [](const Powers& s) { return s.pp - s.pg * s.pg / s.gg; };
  // The lowest point of a parabola through three points, three times, each time closer.
  double T = rig.T_C, width = 0.1;
  for (int round = 0; round < 4; ++round) {
    const std::array<Powers, 3> at =
        pressure_powers<3>(runs, signals, {T * (1.0 - width), T, T * (1.0 + width)});
    const double a = left(at[0]), b = left(at[1]), c = left(at[2]);
    const double bend = a - 2.0 * b + c;
    const double move = bend > 0.0 ? 0.5 * (a - c) / bend : (a < c ? -1.0 : 1.0);
    T *= 1.0 + width * std::clamp(move, -3.0, 3.0);
    if (std::abs(move) < 1.0) width *= 0.3;
  }
  const Powers s = pressure_powers<1>(runs, signals, {T})[0];
  base.T_C = T;
  base.K_C = s.pg / s.gg;
}

double mean_square(const std::vector<double>& x, double& count) {
  double sum = 0.0;
  for (const double value : x) sum += value * value;
  count += static_cast<double>(x.size());
  return sum;
}

}  // namespace

double acceleration_noise(double angle_sd) {
  const double span = static_cast<double>(kHalf) * kRowTime;
  return std::sqrt(6.0) * angle_sd / (span * span);
}

std::vector<double> velocity_of(const std::vector<double>& angle) {
  const auto last = static_cast<std::ptrdiff_t>(angle.size()) - 1;
  // Runs begin at rest, so the angle before the first row mirrors the angle after it.
  const auto at = [&](std::ptrdiff_t k) {
    return angle[static_cast<std::size_t>(std::min(std::abs(k), last))];
  };
  std::vector<double> v(angle.size());
  for (std::ptrdiff_t k = 0; k <= last; ++k) {
    if (k >= 2 && k + 2 <= last) {
      const double* x = angle.data() + k;
      v[static_cast<std::size_t>(k)] = (8.0 * (x[1] - x[-1]) - x[2] + x[-2]) / 12.0 * kRate;
    } else {
      v[static_cast<std::size_t>(k)] = (8.0 * (at(k + 1) - at(k - 1)) - at(k + 2) + at(k - 2)) / 12.0 * kRate;
    }
  }
  return v;
}

std::vector<double> triangle_mean(const std::vector<double>& x) {
  // Two running means of kHalf rows each.
  const auto running = [](const std::vector<double>& in) {
    std::vector<double> out;
    if (in.size() < kHalf) return out;
    out.reserve(in.size());
    double sum = 0.0;
    for (std::size_t i = 0; i < in.size(); ++i) {
      sum += in[i];
      if (i + 1 < kHalf) continue;
      out.push_back(sum / static_cast<double>(kHalf));
      sum -= in[i + 1 - kHalf];
    }
    return out;
  };
  return running(running(x));
}

std::vector<double> unit_lag(const std::vector<double>& command, double T_C) {
  const double share = 1.0 - std::exp(-kRowTime / T_C);
  std::vector<double> g(command.size());
  double value = command.front();
  for (std::size_t k = 0; k < command.size(); ++k) {
    g[k] = value;
    value += share * (command[k] - value);
  }
  return g;
}

Baseline fit_baseline(const Rig& rig, const std::vector<RunPlan>& runs, const std::vector<Signals>& signals) {
  Normal normal(4);
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (runs[i].heldout) continue;
    const Signals& s = signals[i];
    const std::vector<double> v = velocity_of(s.angle);
    for (std::size_t k = 0; k < v.size(); ++k) {
      const double row[4] = {rig.r * rig.r * s.angle[k], rig.r * 0.5 * (s.p2[k] - s.p1[k]),
                             -v[k] * v[k] * v[k], -v[k]};
      const double T = (s.F2[k] - s.F1[k]) * rig.r;
      for (std::size_t a = 0; a < 4; ++a) {
        for (std::size_t b = 0; b < 4; ++b) normal.matrix[a * 4 + b] += row[a] * row[b];
        normal.right[a] += row[a] * T;
      }
    }
  }
  const std::vector<double> x = normal.solve();
  Baseline base{x[0], x[1], x[2], x[3], 0.0, 0.0};
  fit_valves(base, rig, runs, signals);
  return base;
}

Residuals residuals(const Rig& rig, const Baseline& base, const RunPlan& run, const Signals& s) {
  Residuals out = torque_residuals(rig, base, run, s);
  out.p1 = pressure_residual(base, run.command_1, s.p1);
  out.p2 = pressure_residual(base, run.command_2, s.p2);
  return out;
}

std::vector<double> pressure_residual(const Baseline& base, const std::vector<double>& command,
                                      const std::vector<double>& p) {
  std::vector<double> rest = unit_lag(command, base.T_C);
  for (std::size_t k = 0; k < p.size(); ++k) rest[k] = p[k] - base.K_C * rest[k];
  return rest;
}

Residuals torque_residuals(const Rig& rig, const Baseline& base, const RunPlan& run, const Signals& s) {
  Residuals out;
  const std::size_t rows = s.angle.size();
  const std::vector<double> v = velocity_of(s.angle);
  std::vector<double> torque(rows);
  out.torque.resize(rows);
  for (std::size_t k = 0; k < rows; ++k) {
    torque[k] = (s.F2[k] - s.F1[k]) * rig.r;
    out.torque[k] =
        torque[k] - (base.A * rig.r * rig.r * s.angle[k] + base.B * rig.r * 0.5 * (s.p2[k] - s.p1[k]) -
                     base.C * v[k] * v[k] * v[k] - base.D * v[k]);
  }
  if (run.free && rows > 2 * kHalf) {
    out.balance = triangle_mean(torque);
    constexpr double kSpan = static_cast<double>(kHalf) * kRowTime;
    for (std::size_t k = 0; k < out.balance.size(); ++k) {
      // The triangle's middle is row k + kHalf − 1.
      const std::size_t m = k + kHalf - 1;
      if (m < kHalf || m + kHalf >= rows) {
        out.balance[k] = 0.0;
        continue;
      }
      out.balance[k] -=
          rig.inertia * (s.angle[m + kHalf] - 2.0 * s.angle[m] + s.angle[m - kHalf]) / (kSpan * kSpan);
    }
  }
  return out;
}

Gap gap_of(const Rig& rig, const Baseline& base, const std::vector<RunPlan>& runs,
           const std::vector<Signals>& signals, bool heldout) {
  struct Mean {
    double sum = 0, count = 0;
    void add(const std::vector<double>& x) { sum += mean_square(x, count); }
    [[nodiscard]] double root() const { return count > 0.0 ? std::sqrt(sum / count) : 0.0; }
  };
  Mean torque, driven, pressure, p1, p2, balance;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (runs[i].heldout != heldout) continue;
    const Residuals rest = residuals(rig, base, runs[i], signals[i]);
    torque.add(rest.torque);
    if (!runs[i].free) driven.add(rest.torque);
    for (Mean* m : {&pressure, &p1}) m->add(rest.p1);
    for (Mean* m : {&pressure, &p2}) m->add(rest.p2);
    balance.add(rest.balance);
  }
  return {torque.root(), pressure.root(), balance.root(), driven.root(), p1.root(), p2.root()};
}

}  // namespace blind
