#include "isac/estimate/motion_start.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "isac/estimate/linear_algebra.hpp"
#include "isac/series/differentiate.hpp"

namespace isac::estimate::motion {
namespace {

constexpr std::array<double, 6> kLagsTried{0.02, 0.04, 0.08,
                                           0.16, 0.32, 0.64};  // s; a factor of two brackets the minimum
/// kg m²; tried where neither the data sheet nor a held torque tells the inertia: a known gravity torque fixes the scale only
/// through the difference between sin φ and φ, which derivatives of noisy angles do not show.
constexpr std::array<double, 9> kInertiasTried{1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0};
constexpr int kTorques = kLag;  // parameters that stand before a torque: inertia … friction

/// Smoothed angle and derivatives of one run, thinned to what a start needs.
struct Smooth {
  std::vector<double> time, angle, speed, acceleration, command;
  std::vector<std::size_t> row;
};

Smooth smooth(const Prepared& run) {
  const auto choice = series::choose_window(run.time, run.angle);
  const auto derivatives = series::differentiate(run.time, run.angle, choice.polynomial);
  Smooth out;
  const std::size_t stride = std::max<std::size_t>(1, run.time.size() / 20000);
  for (std::size_t i = 0; i < run.time.size(); i += stride) {
    if (!std::isfinite(derivatives.second[i])) continue;
    out.row.push_back(i);
    out.angle.push_back(derivatives.value[i]);
    out.speed.push_back(derivatives.first[i]);
    out.acceleration.push_back(derivatives.second[i]);
  }
  return out;
}

std::vector<double> lagged(const Prepared& run, double lag, bool from_zero) {
  std::vector<double> q(run.time.size());
  double value = from_zero ? 0.0 : run.command_from.front();
  q[0] = value;
  for (std::size_t i = 1; i < q.size(); ++i) {
    const double keep = std::exp(-(run.time[i] - run.time[i - 1]) / lag);
    value = keep * value + (1 - keep) * 0.5 * (run.command_from[i - 1] + run.command_to[i - 1]);
    q[i] = value;
  }
  return q;
}

/// Linear fit of the torques that `known` leaves open, for one lag; sums over all runs.
std::pair<double, MotionVector> fit_on_derivatives(std::span<const Prepared> runs,
                                                   const std::vector<Smooth>& smoothed,
                                                   const std::vector<std::vector<double>>& pressure,
                                                   const MotionVector& known, const MotionOptions& options) {
  std::vector<std::size_t> open;
  for (std::size_t j = 0; j < static_cast<std::size_t>(kTorques); ++j) {
    if (!std::isfinite(known[j])) open.push_back(j);
  }
  const auto size = static_cast<Eigen::Index>(open.size());
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd moment = Eigen::VectorXd::Zero(size);
  double error = 0;
  for (std::size_t run = 0; run < runs.size(); ++run) {
    const Smooth& s = smoothed[run];
    for (std::size_t i = 0; i < s.row.size(); ++i) {
      const double r = options.wheel_radius, w = s.speed[i];
      const std::array<double, kTorques> column{s.acceleration[i],
                                                -r * r * s.angle[i],
                                                -r * pressure[run][s.row[i]],
                                                w * w * w,
                                                w,
                                                std::tanh(w / options.friction_speed)};
      double rest = options.gravity_torque * std::sin(s.angle[i]);
      for (std::size_t j = 0; j < column.size(); ++j) {
        if (std::isfinite(known[j])) rest += known[j] * column[j];
      }
      error += rest * rest;
      for (Eigen::Index a = 0; a < size; ++a) {
        const double ca = column[open[static_cast<std::size_t>(a)]];
        moment[a] -= ca * rest;
        for (Eigen::Index b = 0; b <= a; ++b) gram(a, b) += ca * column[open[static_cast<std::size_t>(b)]];
      }
    }
  }
  MotionVector start = known;
  if (size > 0) {
    gram = gram.selfadjointView<Eigen::Lower>();
    const Eigen::VectorXd scale = gram.diagonal().cwiseMax(1e-300).cwiseSqrt();
    const Eigen::MatrixXd unit = scale.cwiseInverse().asDiagonal() * gram * scale.cwiseInverse().asDiagonal();
    const Eigen::VectorXd theta =
        solve_symmetric(unit + 1e-10 * Eigen::MatrixXd::Identity(size, size), moment.cwiseQuotient(scale))
            .cwiseQuotient(scale);
    error -= 2 * theta.dot(moment) - theta.dot(gram * theta);
    for (Eigen::Index a = 0; a < size; ++a) start[open[static_cast<std::size_t>(a)]] = theta[a];
  }
  // Signs that would make the first simulation run away.
  if (!std::isfinite(known[kInertia])) start[kInertia] = std::max(std::abs(start[kInertia]), 1e-9);
  if (!std::isfinite(known[kA])) start[kA] = -std::abs(start[kA]);
  for (const std::size_t j : {std::size_t{kC}, std::size_t{kD}, std::size_t{kFriction}}) {
    if (!std::isfinite(known[j])) start[j] = std::max(0.0, start[j]);
  }
  return {error / (start[kInertia] * start[kInertia]), start};  // in (rad/s²)², comparable between inertias
}

}  // namespace

std::vector<MotionVector> find_starts(std::span<const Prepared> runs, const MotionOptions& options) {
  std::vector<Smooth> smoothed;
  for (const Prepared& run : runs) smoothed.push_back(smooth(run));
  std::vector<double> lags(kLagsTried.begin(), kLagsTried.end());
  if (std::isfinite(options.start[kLag])) lags = {options.start[kLag]};
  const bool torque_known = std::any_of(options.start.begin(), options.start.begin() + kTorques,
                                        [](double value) { return std::isfinite(value) && value != 0; });
  if (!torque_known && options.gravity_torque == 0) return {};
  std::vector<double> inertias{options.start[kInertia]};
  if (!torque_known) inertias.assign(kInertiasTried.begin(), kInertiasTried.end());

  std::vector<std::pair<double, MotionVector>> found;
  for (const double lag : lags) {
    std::vector<std::vector<double>> pressure;
    for (const Prepared& run : runs) pressure.push_back(lagged(run, lag, options.initial_rest));
    for (const double inertia : inertias) {
      MotionVector known = options.start;
      known[kLag] = lag;
      known[kInertia] = inertia;
      found.push_back(fit_on_derivatives(runs, smoothed, pressure, known, options));
    }
  }
  std::sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<MotionVector> starts;
  for (const auto& [error, start] : found) starts.push_back(start);
  return starts;
}

}  // namespace isac::estimate::motion
