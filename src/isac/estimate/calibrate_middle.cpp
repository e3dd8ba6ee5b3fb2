#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/estimate/calibrate.hpp"
#include "isac/estimate/linear_algebra.hpp"
#include "isac/estimate/step_noise.hpp"

namespace isac::estimate {
namespace {

constexpr double kCountVariance = 1.0 / 12;                     // one step of the encoder
constexpr double kStillMoving = 2;                              // counts between the halves of one approach
constexpr double kLeastPressureSpan = 0.05 * kPascalPerKgfCm2;  // ten standard deviations of one reading
constexpr std::size_t kLeastForShift = 4;

Estimated estimate(const char* name, const char* unit, double value, double error, double dof) {
  Estimated e;
  e.name = name;
  e.unit = unit;
  e.value = value;
  e.std_error = error;
  const double half = student_95(dof) * error;
  e.ci_low = value - half;
  e.ci_high = value + half;
  return e;
}

Estimated refused(const char* name, const char* unit, const char* reason) {
  Estimated e;
  e.name = name;
  e.unit = unit;
  e.identifiable = false;
  e.reason = reason;
  return e;
}

double mean_of(std::span<const double> values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

struct Rest {
  double count = 0, delta_pressure = 0;
  int side = 0;
};

/// Means of all approaches that have readings; says which were still moving.
std::vector<Rest> rests_of(std::span<const MiddleApproach> approaches, const std::string& name,
                           Warnings& warnings) {
  std::vector<Rest> rests;
  for (const MiddleApproach& a : approaches) {
    std::vector<double> counts;
    for (const double c : a.counts)
      if (std::isfinite(c)) counts.push_back(c);
    if (counts.empty()) continue;
    const std::span<const double> all(counts);
    rests.push_back({mean_of(all), a.delta_pressure, a.from_side});
    const std::size_t half = all.size() / 2;
    if (all.size() >= 4 && std::abs(mean_of(all.first(half)) - mean_of(all.subspan(half))) > kStillMoving) {
      warnings.push_back({"still_moving", fmt::format("{}: approach {} was not at rest yet: wait longer "
                                                      "before reading",
                                                      name, rests.size())});
    }
  }
  return rests;
}

bool shift_can_be_told(const std::vector<Rest>& rests) {
  const auto [low, high] = std::minmax_element(rests.begin(), rests.end(), [](const Rest& a, const Rest& b) {
    return a.delta_pressure < b.delta_pressure;
  });
  return rests.size() >= kLeastForShift &&
         std::all_of(rests.begin(), rests.end(),
                     [](const Rest& r) { return std::isfinite(r.delta_pressure); }) &&
         high->delta_pressure - low->delta_pressure > kLeastPressureSpan;
}

bool sides_can_be_told(const std::vector<Rest>& rests) {
  const auto from = [&rests](int sign) {
    return std::count_if(rests.begin(), rests.end(), [sign](const Rest& r) { return r.side * sign > 0; });
  };
  const bool all_known = std::all_of(rests.begin(), rests.end(), [](const Rest& r) { return r.side != 0; });
  return all_known && from(1) >= 2 && from(-1) >= 2;
}

}  // namespace

// Least squares on  count = middle + shift · Δp + ½ difference · side,  each column only where it can be told. With sides
// alone this is the value halfway between both sides' means, however many approaches each has.
MiddleCalibration calibrate_middle(std::span<const MiddleApproach> approaches, const std::string& name) {
  MiddleCalibration out;
  const std::vector<Rest> rests = rests_of(approaches, name, out.warnings);
  if (rests.size() < 2) {
    throw Error(
        ErrorKind::kAnswerIsNo, "too_few_approaches",
        fmt::format("{}: {} approach given; repeat it, best three times from each side", name, rests.size()));
  }
  const bool shift = shift_can_be_told(rests), sides = sides_can_be_told(rests);
  const auto n = static_cast<Eigen::Index>(rests.size());
  const Eigen::Index columns = 1 + (shift ? 1 : 0) + (sides ? 1 : 0), side_column = shift ? 2 : 1;
  Eigen::MatrixXd X = Eigen::MatrixXd::Ones(n, columns);
  Eigen::VectorXd y(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Rest& rest = rests[static_cast<std::size_t>(i)];
    y[i] = rest.count;
    if (shift) X(i, 1) = rest.delta_pressure / kPascalPerKgfCm2;  // of order one beside the other columns
    if (sides) X(i, side_column) = rest.side > 0 ? 0.5 : -0.5;
  }
  const Eigen::MatrixXd inverse = inverse_square(X.transpose() * X);
  const Eigen::VectorXd solution = least_squares(X, y);
  const double dof = static_cast<double>(n - columns);
  const double scatter = (y - X * solution).squaredNorm() / std::max(1.0, dof) + kCountVariance;
  const auto error = [&](Eigen::Index k) { return std::sqrt(scatter * inverse(k, k)); };

  out.middle = estimate("middle", "count", solution[0], error(0), dof);
  out.shift =
      shift ? estimate("shift", "count/Pa", solution[1] / kPascalPerKgfCm2, error(1) / kPascalPerKgfCm2, dof)
            : refused("shift", "count/Pa", "needs four approaches at different pressure differences");
  out.side_difference =
      sides ? estimate("side_difference", "count", solution[side_column], error(side_column), dof)
            : refused("side_difference", "count", "needs two approaches from each side");
  for (const Rest& rest : rests)
    out.approaches.push_back(rest.count - (shift ? out.shift.value * rest.delta_pressure : 0.0));
  if (sides && (out.side_difference.ci_low > 0 || out.side_difference.ci_high < 0)) {
    out.warnings.push_back(
        {"sides_differ", fmt::format("{}: the middle depends on the side by {:.3g} counts: friction or play; "
                                     "the value halfway is given",
                                     name, out.side_difference.value)});
  }
  return out;
}

}  // namespace isac::estimate
