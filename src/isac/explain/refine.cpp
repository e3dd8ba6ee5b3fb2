#include "isac/explain/refine.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string_view>

#include "isac/estimate/linear_algebra.hpp"
#include "isac/explain/bounded_fit.hpp"
#include "isac/explain/projection.hpp"

namespace isac::explain {
namespace {

class Projected {
 public:
  Projected(const Around& place, const Hypothesis& hypothesis, const Values& start,
            std::vector<std::size_t> free, std::vector<double> scale)
      : place_(place),
        hypothesis_(hypothesis),
        values_(start),
        free_(std::move(free)),
        scale_(std::move(scale)),
        is_linear_(hypothesis.info().linear && place.held.slopes.cols() == 0 &&
                   place.predictor->adds_up(place.fit->model, hypothesis)) {}

  Eigen::VectorXd residual_at(const Eigen::VectorXd& x) const {
    Active a;
    a.hypothesis = &hypothesis_;
    a.values = values_;
    for (std::size_t j = 0; j < free_.size(); ++j)
      a.values[free_[j]] = x[static_cast<Eigen::Index>(j)] * scale_[j];
    return place_.release(place_.residual + place_.project(response(*place_.predictor, *place_.fit,
                                                                    place_.here, a, *place_.weights)));
  }

  bool operator()(const Eigen::VectorXd& at, Eigen::VectorXd& here, Eigen::MatrixXd* jacobian) {
    // A step that was good is where the next begins: its residual is known.
    if (last_at_.size() != at.size() || last_at_ != at) {
      last_ = residual_at(at);
      last_at_ = at;
    }
    here = last_;
    if (!here.allFinite()) return false;
    if (jacobian == nullptr || (is_linear_ && jacobian->cols() == at.size())) return true;
    jacobian->resize(here.size(), at.size());
    Eigen::VectorXd x = at;
    for (Eigen::Index k = 0; k < at.size(); ++k) {
      const auto i = static_cast<std::size_t>(k);
      // Onsets and widths move events from sample to sample: a longer step sees more of them.
      const bool shape = std::isnan(hypothesis_.info().parameters[free_[i]].null_value);
      const bool memory = hypothesis_.info().state_count > 0;
      double step = memory ? 1e-2 : shape ? 2e-3 : 1e-4;
      if ((x[k] + step) * scale_[i] > hypothesis_.upper[free_[i]]) step = -step;
      x[k] = at[k] + step;
      const Eigen::VectorXd there = residual_at(x);
      x[k] = at[k];
      if (!there.allFinite()) return false;
      jacobian->col(k) = (there - here) / step;
    }
    return true;
  }

 private:
  const Around& place_;
  const Hypothesis& hypothesis_;
  Values values_;
  std::vector<std::size_t> free_;
  std::vector<double> scale_;
  bool is_linear_;  ///< the slopes are the same everywhere
  Eigen::VectorXd last_at_, last_;
};

}  // namespace

Around around(const Predictor& predictor, const Fit& fit, const Weights& weights) {
  Around place;
  place.predictor = &predictor;
  place.fit = &fit;
  place.weights = &weights;
  place.basis = basis_of(sensitivities(predictor, fit, weights, nullptr, &place.held));
  for (Eigen::Index j = 0; j < place.held.slopes.cols(); ++j)
    place.held.slopes.col(j) = place.project(place.held.slopes.col(j));
  place.held_gram = place.held.slopes.transpose() * place.held.slopes;
  place.here = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(predictor.rows()));
  predictor.predict(fit.model, kAllChains, place.here);
  place.residual = place.project(fit.residual);
  return place;
}

namespace {

/// How far tolerances come back whose slopes have this Gram matrix and go with what is left by `toward`.
Eigen::VectorXd come_back(const Held& held, Eigen::MatrixXd gram, const Eigen::VectorXd& toward) {
  const double largest = std::max(gram.diagonal().maxCoeff(), 1e-300);
  for (Eigen::Index i = 0; i < gram.rows(); ++i) gram(i, i) += 1e-9 * gram(i, i) + 1e-12 * largest;
  return bounded_quadratic(gram, toward, held.low, held.high);
}

}  // namespace

Eigen::VectorXd Around::project(const Eigen::VectorXd& x) const {
  return x - basis * (basis.transpose() * x);
}

Eigen::VectorXd Around::release(Eigen::VectorXd left) const {
  if (held.slopes.cols() > 0 && left.allFinite())
    left += held.slopes * come_back(held, held_gram, held.slopes.transpose() * left);
  return left;
}

Eigen::VectorXd Around::left_beside(const Eigen::Ref<const Eigen::VectorXd>& x) const {
  const double norm = x.norm();
  if (!(norm > 0)) return release(residual);
  Beside beside(*this);
  beside.take(x / norm);
  return beside.left();
}

Beside::Beside(const Around& place)
    : place_(place), held_(place.residual), slopes_(place.held.slopes), gram_(place.held_gram) {}

double Beside::loss_with(const Eigen::VectorXd& unit) const {
  const double along = unit.dot(held_), loss = held_.squaredNorm() - along * along;
  if (slopes_.cols() == 0 || !std::isfinite(loss)) return loss;
  const Eigen::VectorXd share = slopes_.transpose() * unit,
                        toward = slopes_.transpose() * held_ - along * share;
  const Eigen::MatrixXd gram = gram_ - share * share.transpose();
  const Eigen::VectorXd back = come_back(place_.held, gram, toward);
  return loss + 2 * toward.dot(back) + back.dot(gram * back);
}

void Beside::take(const Eigen::VectorXd& unit) {
  held_ -= unit * unit.dot(held_);
  if (slopes_.cols() == 0) return;
  slopes_ -= unit * (unit.transpose() * slopes_);
  gram_ = slopes_.transpose() * slopes_;
}

Eigen::VectorXd Beside::left() const {
  if (slopes_.cols() == 0 || !held_.allFinite()) return held_;
  return held_ + slopes_ * come_back(place_.held, gram_, slopes_.transpose() * held_);
}

namespace {

/// A stop that the motion never reaches has no slope: where one stands so, it is set to each angle at which the other hypotheses have theirs,
/// and the fit goes on from the best.
void try_other_stop(Projected& problem, const Hypothesis& hypothesis, const Eigen::VectorXd& lower,
                    const Eigen::VectorXd& upper, const std::vector<double>& scale, int iterations,
                    Eigen::VectorXd& x, Refined& refined) {
  constexpr double kWorth = 1e-6;  // of the loss
  for (Eigen::Index side = 1; side < x.size(); ++side) {
    const auto i = static_cast<std::size_t>(side);
    Eigen::VectorXd best = x;
    best[side] = hypothesis.info().parameters[i].typical > 0 ? upper[side] : lower[side];
    if (problem.residual_at(best).squaredNorm() > refined.loss * (1 + kWorth)) continue;  // it is reached
    best = x;
    double least = refined.loss * (1 - kWorth);
    for (const Values& shape : hypothesis.shapes) {
      Eigen::VectorXd tried = x;
      tried[side] = std::clamp(shape[i] / scale[i], lower[side], upper[side]);
      const double loss = tried == x ? refined.loss : problem.residual_at(tried).squaredNorm();
      if (loss >= least) continue;
      least = loss;
      best = std::move(tried);
    }
    if (best == x) continue;
    BoundedFit fit =
        bounded_fit(std::ref(problem), best, lower, upper, {.rounds = iterations, .tolerance = 1e-6});
    if (fit.residual.size() == 0 || !(fit.residual.squaredNorm() < refined.loss)) continue;
    x = fit.x;
    refined.loss = fit.residual.squaredNorm();
    refined.residual = std::move(fit.residual);
  }
}

/// Of two amplitudes that only their difference tells (the zeros of two forces that pull against each other; the leaks of two muscles, whose common part
/// is K_C's and T_C's) the fit may drive both to an end of their range, or anywhere along what they have in common. One of them is absent instead, where
/// the other makes up for it.
void leave_out_what_nothing_tells(Projected& problem, const Hypothesis& hypothesis,
                                  const Eigen::VectorXd& lower, const Eigen::VectorXd& upper,
                                  const std::vector<std::size_t>& free, const std::vector<double>& scale,
                                  int iterations, const Eigen::MatrixXd& curvature, Eigen::VectorXd& x,
                                  Refined& refined) {
  constexpr double kAsWell = 9;  // weighted squares, three sigma: what tells less of the second tells nothing
  constexpr double kFarMore = 100;
  constexpr double kAlike = 0.1;  // of the larger: what they may have in common
  const auto alike = [&](Eigen::Index j) {
    if (x.size() != 2 || hypothesis.info().parameter_count != 2) return false;
    const double a = x[j] * scale[static_cast<std::size_t>(j)],
                 b = x[1 - j] * scale[static_cast<std::size_t>(1 - j)];
    return a * b > 0 && std::min(std::abs(a), std::abs(b)) > kAlike * std::max(std::abs(a), std::abs(b));
  };
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    const std::size_t k = free[static_cast<std::size_t>(j)];
    const double null = hypothesis.info().parameters[k].null_value, margin = 1e-6 * (upper[j] - lower[j]);
    const bool at_end = x[j] <= lower[j] + margin || x[j] >= upper[j] - margin;
    if (!hypothesis.amplitude[k] || null != 0 || lower[j] > 0 || upper[j] < 0 || x[j] == 0) continue;
    if (!at_end && !alike(j)) continue;
    if (!at_end && curvature.rows() == x.size()) {  // what its absence costs, were the residual straight
      const Eigen::VectorXd column = estimate::solve_symmetric(curvature, Eigen::VectorXd::Unit(x.size(), j));
      if (column[j] > 0 && x[j] * x[j] / column[j] > kFarMore * kAsWell) continue;
    }
    Eigen::VectorXd low = lower, high = upper, without = x;
    low[j] = high[j] = without[j] = 0;
    if (alike(j))  // the other as it is without what they have in common
      without[1 - j] =
          x[1 - j] - x[j] * scale[static_cast<std::size_t>(j)] / scale[static_cast<std::size_t>(1 - j)];
    BoundedFit fit =
        bounded_fit(std::ref(problem), without, low, high, {.rounds = iterations, .tolerance = 1e-6});
    if (fit.residual.size() == 0 || !(fit.residual.squaredNorm() < refined.loss + kAsWell)) continue;
    x = fit.x;
    refined.loss = fit.residual.squaredNorm();
    refined.residual = std::move(fit.residual);
  }
}

}  // namespace

Refined refine(const Around& place, const Hypothesis& hypothesis, const Values& start, int iterations) {
  std::vector<std::size_t> free;
  std::vector<double> scale;
  for (int i = 0; i < hypothesis.info().parameter_count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    if (!hypothesis.free[k]) continue;
    free.push_back(k);
    double s = std::max(std::abs(start[k]), 1e-3 * std::abs(hypothesis.info().parameters[i].typical));
    if (!(s > 0)) s = 1;
    scale.push_back(s);
  }
  const auto m = static_cast<Eigen::Index>(free.size());
  Eigen::VectorXd x(m), lower(m), upper(m);
  for (Eigen::Index j = 0; j < m; ++j) {
    const auto i = static_cast<std::size_t>(j);
    x[j] = start[free[i]] / scale[i];
    lower[j] = hypothesis.lower[free[i]] / scale[i];
    upper[j] = hypothesis.upper[free[i]] / scale[i];
  }
  Projected problem(place, hypothesis, start, free, scale);
  BoundedFit fit = bounded_fit(std::ref(problem), x, lower, upper, {.rounds = iterations, .tolerance = 1e-6});
  x = fit.x;
  Refined refined;
  refined.residual = std::move(fit.residual);
  if (refined.residual.size() == 0 || !refined.residual.allFinite())
    refined.residual = place.residual;  // breaks down there
  refined.loss = refined.residual.squaredNorm();
  const std::string_view id = hypothesis.info().id;
  const bool staircase = (hypothesis.info().state_count > 0 &&
                          (hypothesis.dry || hypothesis.reads_angle || id == "valve_hysteresis")) ||
                         id == "valve_stiction";
  if (staircase) {
    // Events make the loss a staircase on which derivatives mislead: one parameter after another, ever finer.
    for (const double change : {0.3, 0.1, 0.03, 0.01}) {
      bool better = true;
      for (int round = 0; better && round < 3; ++round) {
        better = false;
        for (Eigen::Index j = 0; j < m; ++j)
          for (const double factor : {1 + change, 1 / (1 + change)}) {
            Eigen::VectorXd tried = x;
            tried[j] = std::clamp(x[j] * factor, lower[j], upper[j]);
            Eigen::VectorXd residual = problem.residual_at(tried);
            const double loss = residual.squaredNorm();
            if (!(loss < refined.loss * (1 - 1e-7))) continue;
            refined.loss = loss;
            refined.residual = std::move(residual);
            x = std::move(tried);
            better = true;
          }
      }
    }
  }
  leave_out_what_nothing_tells(problem, hypothesis, lower, upper, free, scale, iterations, fit.curvature, x,
                               refined);
  if (id == "end_stop") try_other_stop(problem, hypothesis, lower, upper, scale, iterations, x, refined);
  refined.values = start;
  for (Eigen::Index j = 0; j < m; ++j)
    refined.values[free[static_cast<std::size_t>(j)]] = x[j] * scale[static_cast<std::size_t>(j)];
  return refined;
}

}  // namespace isac::explain
