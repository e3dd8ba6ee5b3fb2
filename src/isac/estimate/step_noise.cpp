#include "isac/estimate/step_noise.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>

namespace isac::estimate {

double student_95(double degrees_of_freedom) {
  return boost::math::quantile(boost::math::students_t(std::max(1.0, degrees_of_freedom)), 0.975);
}

double chi_square_tail(double statistic, double degrees_of_freedom) {
  if (!(statistic > 0)) return 1;
  return boost::math::cdf(boost::math::complement(boost::math::chi_squared(degrees_of_freedom), statistic));
}

std::vector<double> modelled_autocovariance(std::span<const double> residuals) {
  const std::size_t n = residuals.size();
  const std::size_t max_order = std::min<std::size_t>(12, n / 10);
  std::vector<double> gamma(max_order + 1, 0.0);
  for (std::size_t k = 0; k <= max_order; ++k) {
    for (std::size_t i = k; i < n; ++i) gamma[k] += residuals[i] * residuals[i - k];
    gamma[k] /= static_cast<double>(n);
  }
  if (!(gamma[0] > 0)) return {0.0};

  // Levinson–Durbin; the order with the least AIC (BIC takes too few for noise that a quantum has whitened).
  std::vector<double> phi, best_phi;
  double variance = gamma[0];
  double best_aic = std::log(variance);
  const double penalty = 2 / static_cast<double>(n);
  for (std::size_t k = 1; k <= max_order; ++k) {
    double reflection = gamma[k];
    for (std::size_t j = 1; j < k; ++j) reflection -= phi[j - 1] * gamma[k - j];
    reflection /= variance;
    std::vector<double> next(k);
    for (std::size_t j = 1; j < k; ++j) next[j - 1] = phi[j - 1] - reflection * phi[k - j - 1];
    next[k - 1] = reflection;
    phi = std::move(next);
    variance *= 1 - reflection * reflection;
    if (!(variance > 0)) break;
    const double aic = std::log(variance) + penalty * static_cast<double>(k);
    if (aic < best_aic) {
      best_aic = aic;
      best_phi = phi;
    }
  }

  // γ beyond the order by the recursion of the model, until it has died out.
  const std::size_t order = best_phi.size();
  gamma.resize(order + 1);
  const std::size_t longest = n / 4;
  std::size_t quiet = order == 0 ? order + 2 : 0;
  while (quiet < order + 1 && gamma.size() < longest) {
    double next = 0;
    for (std::size_t j = 1; j <= order; ++j) next += best_phi[j - 1] * gamma[gamma.size() - j];
    quiet = std::abs(next) < 0.005 * gamma[0] ? quiet + 1 : 0;
    gamma.push_back(next);
  }
  return gamma;
}

namespace {

// A reading that rests on one quantum carries an error that is the same in all its rows: uniform, variance q²/12.
// Where the noise exceeds the quantum no reading rests this long, and the residuals hold the quantisation already.
constexpr std::size_t kRestingRows = 8;

Eigen::Matrix4d quantisation_meat(std::span<const double> jacobian, const StepData& data) {
  Eigen::Matrix4d meat = Eigen::Matrix4d::Zero();
  const std::size_t n = data.reading.size();
  std::size_t begin = 0;
  while (begin < n) {
    std::size_t end = begin + 1;
    while (end < n && data.reading[end] == data.reading[begin]) ++end;
    if (end - begin >= kRestingRows) {
      Eigen::Vector4d sum = Eigen::Vector4d::Zero();
      for (std::size_t i = begin; i < end; ++i) sum += Eigen::Map<const Eigen::Vector4d>(&jacobian[4 * i]);
      meat += data.quantum * data.quantum / 12.0 * sum * sum.transpose();
    }
    begin = end;
  }
  return meat;
}

}  // namespace

StepCovariance step_covariance(std::span<const double> jacobian, std::span<const double> residuals,
                               const StepData& data, const StepParameters& parameters) {
  StepCovariance out;
  const std::size_t n = residuals.size();
  if (n < 8) return out;
  const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor>> raw(
      jacobian.data(), static_cast<Eigen::Index>(n), 4);
  // Scaled columns, so that "singular" does not depend on units.
  const double size = std::max(std::abs(parameters[1]), 1e-300);
  const Eigen::Vector4d scale(size, size, parameters[2], parameters[2]);
  const Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor> j = raw * scale.asDiagonal();
  const Eigen::Matrix4d information = j.transpose() * j;
  const Eigen::LDLT<Eigen::Matrix4d> factor(information);
  if (factor.info() != Eigen::Success || !factor.isPositive() ||
      !(factor.vectorD().minCoeff() > 1e-12 * factor.vectorD().maxCoeff()))
    return out;
  const Eigen::Matrix4d bread = factor.solve(Eigen::Matrix4d::Identity());

  const std::vector<double> gamma = modelled_autocovariance(residuals);
  Eigen::Matrix4d meat = gamma[0] * information;
  const auto rows = static_cast<Eigen::Index>(n);
  for (std::size_t k = 1; k < gamma.size(); ++k) {
    const auto lag = static_cast<Eigen::Index>(k);
    const Eigen::Matrix4d cross = j.topRows(rows - lag).transpose() * j.bottomRows(rows - lag);
    meat += gamma[k] * (cross + cross.transpose());
  }
  // The fit has eaten tr(H Γ) of the noise's power: E Σr² = n γ0 − tr(B M).
  const double eaten = gamma[0] > 0 ? (bread * meat).trace() / (static_cast<double>(n) * gamma[0]) : 0;
  const double inflation = 1 / std::max(0.2, 1 - eaten);
  double squares = 1, sum = 1;
  for (std::size_t k = 1; k < gamma.size(); ++k) {
    const double rho = gamma[k] / gamma[0];
    squares += 2 * rho * rho;
    sum += 2 * rho;
  }
  out.correlation_rows = std::max(1.0, sum);
  out.degrees_of_freedom = std::max(1.0, static_cast<double>(n) / squares - 4);

  Eigen::Matrix4d total = inflation * meat;
  if (data.quantum > 0) total += scale.asDiagonal() * quantisation_meat(jacobian, data) * scale.asDiagonal();
  out.covariance = scale.asDiagonal() * (bread * total * bread) * scale.asDiagonal();
  out.ok = out.covariance.allFinite();
  return out;
}

}  // namespace isac::estimate
