#include "isac/estimate/velocity_cut.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "isac/estimate/linear_algebra.hpp"
#include "isac/series/statistics.hpp"

namespace isac::estimate {
namespace {

struct Passage {
  double velocity, cube, torque;  ///< means over the same rows, those without spikes in the torque
};

/// Passages through the middle at nearly constant speed.
std::vector<Passage> passages(const JointRows& rows, const std::vector<double>& offset,
                              const std::vector<double>& cube, const std::vector<double>& linear,
                              double half_width) {
  std::vector<Passage> out;
  const std::vector<double>& angle = rows.input[static_cast<int>(Input::kAngle)];
  const std::vector<double>& velocity = rows.input[static_cast<int>(Input::kVelocity)];
  std::vector<double> torque;
  for (const RunRows& run : rows.runs) {
    for (std::size_t i = run.begin; i < run.end; ++i) {
      if (std::abs(angle[i]) > half_width) continue;
      std::size_t end = i;
      double low = velocity[i], high = velocity[i], sum = 0;
      torque.clear();
      while (end < run.end && std::abs(angle[end]) <= half_width &&
             (end == i || rows.time[end] - rows.time[end - 1] <= 2.5 * run.interval)) {
        low = std::min(low, velocity[end]);
        high = std::max(high, velocity[end]);
        sum += linear[end];
        torque.push_back(offset[end]);
        ++end;
      }
      const double mean = sum / static_cast<double>(end - i);
      const bool steady = high - low <= 0.2 * std::abs(mean);
      const bool through = end > i + 2 && (angle[end - 1] - angle[i]) * mean > 0 &&
                           std::abs(angle[end - 1] - angle[i]) > half_width;
      if (steady && through) {
        // A median of the torque beside means of the speed would be off by a twelfth of the speed's bend over the passage.
        const double middle = series::median(torque);
        double limit = 4.0 * series::robust_deviation(torque, false);
        if (!(limit > 0)) limit = std::numeric_limits<double>::infinity();
        Passage passage{0, 0, 0};
        double count = 0;
        for (std::size_t k = i; k < end; ++k) {
          if (std::abs(offset[k] - middle) > limit) continue;
          passage.velocity += linear[k];
          passage.cube += cube[k];
          passage.torque += offset[k];
          ++count;
        }
        if (count > 0)
          out.push_back({passage.velocity / count, passage.cube / count, passage.torque / count});
      }
      i = end;
    }
  }
  return out;
}

}  // namespace

VelocityCut velocity_cut(const JointRows& rows, const JointTerms& terms, const Eigen::VectorXd& theta) {
  VelocityCut cut;
  cut.C.name = "C";
  cut.C.unit = "N m s3";
  cut.D.name = "D";
  cut.D.unit = "N m s";
  // Filtered columns where there are some: torque and speed have then lost the same at the peak of the speed.
  std::vector<double> offset = rows.y(), cube(rows.size(), 0.0), linear(rows.size(), 0.0);
  for (std::size_t k = 0; k < terms.linear().size(); ++k) {
    const std::vector<double>& x = rows.x(k);
    const double value = theta[static_cast<Eigen::Index>(k)];
    for (std::size_t i = 0; i < x.size(); ++i) {
      if (terms.is_cubic_damping(k))
        cube[i] = -x[i];
      else if (terms.is_viscous_damping(k))
        linear[i] = -x[i];
      else
        offset[i] -= value * x[i];
    }
  }
  if (!terms.nonlinear().empty())
    for (std::size_t i = 0; i < offset.size(); ++i)
      offset[i] -= terms.nonlinear_value(rows.state(i), theta.data() + terms.linear().size(), nullptr);
  double reach = 0;
  if (rows.size() > 0) {
    const std::vector<double>& angle = rows.input[static_cast<int>(Input::kAngle)];
    const std::size_t stride = std::max<std::size_t>(1, angle.size() / 100000);
    std::vector<double> size;
    for (std::size_t i = 0; i < angle.size(); i += stride) size.push_back(std::abs(angle[i]));
    reach = series::quantile(size, 0.99);
  }
  const std::vector<Passage> points = passages(rows, offset, cube, linear, 0.1 * reach);
  const auto refuse = [&](const std::string& reason) {
    for (Estimated* e : {&cut.C, &cut.D}) {
      e->identifiable = false;
      e->reason = reason;
    }
  };
  if (points.size() < 8) {
    refuse(
        fmt::format("only {} passages through the middle at constant speed; record a bundle: five minutes by "
                    "hand, all positions, "
                    "speeds up to 6.28 rad/s",
                    points.size()));
    return cut;
  }
  double fastest = 0;
  for (const Passage& point : points) fastest = std::max(fastest, std::abs(point.velocity));
  constexpr int kBins = 24;
  for (int bin = 0; bin < kBins; ++bin) {
    const double low = fastest * (2.0 * bin / kBins - 1.0), high = fastest * (2.0 * (bin + 1) / kBins - 1.0);
    double sum = 0, square = 0, count = 0;
    for (const Passage& point : points)
      if (point.velocity >= low && (point.velocity < high || (bin == kBins - 1 && point.velocity <= high))) {
        sum += point.torque;
        square += point.torque * point.torque;
        ++count;
      }
    if (count < 3) continue;
    const double mean = sum / count;
    cut.velocity.push_back(0.5 * (low + high));
    cut.torque_offset.push_back(mean);
    cut.std_error.push_back(std::sqrt(std::max(0.0, square / count - mean * mean) / (count - 1.0)));
  }
  const auto n = static_cast<Eigen::Index>(points.size());
  Eigen::MatrixXd x(n, 3);  // the constant takes up an offset of the sensors, which has no direction
  Eigen::VectorXd y(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    x(i, 0) = -points[static_cast<std::size_t>(i)].cube;
    x(i, 1) = -points[static_cast<std::size_t>(i)].velocity;
    x(i, 2) = 1.0;
    y[i] = points[static_cast<std::size_t>(i)].torque;
  }
  const Eigen::Vector3d scale = x.colwise().norm().cwiseInverse();
  x = x * scale.asDiagonal();
  const Eigen::Matrix3d inverse = inverse_square(x.transpose() * x);
  if (!inverse.allFinite() || inverse.diagonal().maxCoeff() > 1e6) {
    refuse("all passages have the same speed; record passages from slow to 6.28 rad/s");
    return cut;
  }
  const Eigen::Vector3d fit = inverse * (x.transpose() * y);
  Eigen::Matrix3d meat = Eigen::Matrix3d::Zero();
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector3d row = x.row(i);
    const double leverage = std::min(0.99, row.dot(inverse * row));
    const double residual = (y[i] - row.dot(fit)) / (1.0 - leverage);
    meat += residual * residual * row * row.transpose();
  }
  const Eigen::Matrix3d covariance = inverse * meat * inverse;
  const double limit = series::student_t_limit(0.95, static_cast<double>(n) - 3.0);
  Estimated* estimates[2] = {&cut.C, &cut.D};
  for (int k = 0; k < 2; ++k) {
    estimates[k]->value = fit[k] * scale[k];
    estimates[k]->std_error = std::sqrt(covariance(k, k)) * scale[k];
    estimates[k]->ci_low = estimates[k]->value - limit * estimates[k]->std_error;
    estimates[k]->ci_high = estimates[k]->value + limit * estimates[k]->std_error;
  }
  return cut;
}

}  // namespace isac::estimate
