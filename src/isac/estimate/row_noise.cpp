// How the rows of joint_rows.hpp follow their inputs: what noise of the regressors adds to the normal equations and to the
// prediction, and the slope of the prediction by the angle.
#include <algorithm>
#include <cmath>
#include <iterator>

#include "isac/estimate/joint_rows.hpp"

namespace isac::estimate {
namespace {

/// How the k-th regressor follows one standard deviation of an input, at a state.
double slope(const JointTerms& terms, std::size_t k, const JointState& state, Input input, double sigma) {
  if (sigma == 0.0) return 0.0;
  JointState up = state, down = state;
  set_value(up, input, value_of(state, input) + sigma);
  set_value(down, input, value_of(state, input) - sigma);
  return 0.5 * (terms.regressor(k, up) - terms.regressor(k, down));
}

/// Does x_k change by the same amount everywhere (A, B, D, inertia)? Then one evaluation serves all rows.
bool constant_slope(const JointTerms& terms, std::size_t k, Input input) {
  const JointState a{
      .angle = 0.3, .velocity = 0.7, .acceleration = 0.9, .delta_pressure = 4e4, .mean_pressure = 2e5};
  const JointState b{
      .angle = -0.8, .velocity = -2.1, .acceleration = -1.3, .delta_pressure = -9e4, .mean_pressure = 3e5};
  const double h = input == Input::kDeltaPressure || input == Input::kMeanPressure ? 1e3 : 1e-2;
  const double first = slope(terms, k, a, input, h), second = slope(terms, k, b, input, h);
  const double middle = slope(terms, k, {}, input, h);  // a step at zero is flat on both sides
  return std::abs(first - second) <= 1e-9 * std::abs(first) &&
         std::abs(first - middle) <= 1e-9 * std::abs(first);
}

struct Sensitivity {
  std::size_t k;
  Input input;
  bool constant;
  double cube;  ///< factor of v³ for cubic damping, else 0
};

std::vector<Sensitivity> sensitivities(const JointTerms& terms) {
  std::vector<Sensitivity> out;
  for (std::size_t k = 0; k < terms.linear().size(); ++k)
    for (int z = 0; z < kInputs; ++z)
      if (terms.reads(k, static_cast<Input>(z)))
        out.push_back({k, static_cast<Input>(z), constant_slope(terms, k, static_cast<Input>(z)),
                       terms.is_cubic_damping(k) ? terms.regressor(k, {.velocity = 1.0}) : 0.0});
  return out;
}

double sensitivity_at(const JointTerms& terms, const Sensitivity& s, const JointState& state, double sigma) {
  if (s.cube != 0.0) return s.cube * 3.0 * sigma * (state.velocity * state.velocity - sigma * sigma);
  return slope(terms, s.k, state, s.input, sigma);
}

}  // namespace

Eigen::MatrixXd noise_gram(const JointRows& rows, const JointTerms& terms, const double* omega,
                           std::size_t begin, std::size_t end) {
  const auto n = static_cast<Eigen::Index>(terms.linear().size());
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
  const std::vector<Sensitivity> all = sensitivities(terms);
  const bool filtered = !rows.filtered.empty();
  std::vector<double> d(all.size());
  for (const RunRows& run : rows.runs) {
    const std::size_t first = std::max(begin, run.begin), last = std::min(end, run.end);
    if (first >= last) continue;
    const double* sigma = filtered ? run.noise.filtered : run.noise.raw;
    double weight = 0;
    bool varying = false;
    for (std::size_t i = first; i < last; ++i) weight += omega != nullptr ? omega[i] : 1.0;
    for (std::size_t a = 0; a < all.size(); ++a) {
      if (all[a].constant) d[a] = sensitivity_at(terms, all[a], {}, sigma[static_cast<int>(all[a].input)]);
      varying = varying || !all[a].constant;
    }
    for (std::size_t a = 0; a < all.size(); ++a)
      for (std::size_t b = 0; b < all.size(); ++b)
        if (all[a].constant && all[b].constant && all[a].input == all[b].input)
          out(static_cast<Eigen::Index>(all[a].k), static_cast<Eigen::Index>(all[b].k)) +=
              weight * d[a] * d[b];
    if (!varying) continue;
    // Cubic damping needs moments of the speed only: Var(v̂³ − 3σ²v̂) has the unbiased estimate 9σ²v̂⁴ − 36σ⁴v̂² + 15σ⁶,
    // its covariance with v̂ 3σ²(v̂² − σ²).
    const double s2 = sigma[static_cast<int>(Input::kVelocity)] * sigma[static_cast<int>(Input::kVelocity)];
    const double* v = rows.input[static_cast<int>(Input::kVelocity)].data();
    double m2 = 0, m4 = 0;
    for (std::size_t i = first; i < last; ++i) {
      const double w = omega != nullptr ? omega[i] : 1.0, v2 = v[i] * v[i];
      m2 += w * v2;
      m4 += w * v2 * v2;
    }
    bool others = false;
    for (std::size_t a = 0; a < all.size(); ++a) {
      others = others || (!all[a].constant && all[a].cube == 0.0);
      if (all[a].cube == 0.0) continue;
      const auto ka = static_cast<Eigen::Index>(all[a].k);
      out(ka, ka) +=
          all[a].cube * all[a].cube * (9.0 * s2 * m4 - 36.0 * s2 * s2 * m2 + 15.0 * s2 * s2 * s2 * weight);
      for (std::size_t b = 0; b < all.size(); ++b) {
        if (!all[b].constant || all[b].input != Input::kVelocity || s2 == 0.0) continue;
        const auto kb = static_cast<Eigen::Index>(all[b].k);
        const double cross = all[a].cube * 3.0 * std::sqrt(s2) * d[b] * (m2 - s2 * weight);
        out(ka, kb) += cross;
        out(kb, ka) += cross;
      }
    }
    if (!others) continue;
    for (std::size_t i = first; i < last; ++i) {
      const double w = omega != nullptr ? omega[i] : 1.0;
      const JointState state = rows.state(i);
      for (std::size_t a = 0; a < all.size(); ++a)
        if (!all[a].constant)
          d[a] = sensitivity_at(terms, all[a], state, sigma[static_cast<int>(all[a].input)]);
      const auto general = [&](const Sensitivity& s) { return !s.constant && s.cube == 0.0; };
      for (std::size_t a = 0; a < all.size(); ++a)
        for (std::size_t b = 0; b < all.size(); ++b)
          if (all[a].input == all[b].input && (general(all[a]) || general(all[b])))
            out(static_cast<Eigen::Index>(all[a].k), static_cast<Eigen::Index>(all[b].k)) += w * d[a] * d[b];
    }
  }
  return out;
}

std::vector<double> prediction_variance(const JointRows& rows, const JointTerms& terms,
                                        const Eigen::VectorXd& theta) {
  std::vector<double> out(rows.size(), 0.0);
  const bool filtered = !rows.filtered.empty();
  std::vector<Sensitivity> all = sensitivities(terms);
  for (const RunRows& run : rows.runs) {
    const double* sigma = filtered ? run.noise.filtered : run.noise.raw;
    double base[kInputs] = {};
    for (const Sensitivity& s : all)
      if (s.constant)
        base[static_cast<int>(s.input)] += theta[static_cast<Eigen::Index>(s.k)] *
                                           sensitivity_at(terms, s, {}, sigma[static_cast<int>(s.input)]);
    for (std::size_t i = run.begin; i < run.end; ++i) {
      double part[kInputs];
      std::copy(std::begin(base), std::end(base), std::begin(part));
      const JointState state = rows.state(i);
      for (const Sensitivity& s : all)
        if (!s.constant)
          part[static_cast<int>(s.input)] +=
              theta[static_cast<Eigen::Index>(s.k)] *
              sensitivity_at(terms, s, state, sigma[static_cast<int>(s.input)]);
      for (const double p : part) out[i] += p * p;
    }
  }
  return out;
}

std::vector<double> angle_slope(const JointRows& rows, const JointTerms& terms, const Eigen::VectorXd& theta,
                                double half_step) {
  double constant = 0;
  std::vector<std::size_t> varying;
  for (std::size_t k = 0; k < terms.linear().size(); ++k) {
    if (!terms.reads(k, Input::kAngle)) continue;
    if (constant_slope(terms, k, Input::kAngle))
      constant +=
          theta[static_cast<Eigen::Index>(k)] * slope(terms, k, {}, Input::kAngle, half_step) / half_step;
    else
      varying.push_back(k);
  }
  std::vector<double> out(rows.size(), constant);
  const std::size_t linear = terms.linear().size();
  const bool bent = !terms.nonlinear().empty() && terms.reads(Input::kAngle);
  if (varying.empty() && !bent) return out;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const JointState state = rows.state(i);
    for (const std::size_t k : varying)
      out[i] +=
          theta[static_cast<Eigen::Index>(k)] * slope(terms, k, state, Input::kAngle, half_step) / half_step;
    if (!bent) continue;
    JointState up = state, down = state;
    up.angle += half_step;
    down.angle -= half_step;
    out[i] += (terms.nonlinear_value(up, theta.data() + linear, nullptr) -
               terms.nonlinear_value(down, theta.data() + linear, nullptr)) /
              (2.0 * half_step);
  }
  return out;
}

}  // namespace isac::estimate
