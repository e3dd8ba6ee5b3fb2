#include "isac/explain/fit.hpp"

#include <ceres/cost_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <iterator>
#include <utility>
#include <vector>

#include "isac/explain/bounded_fit.hpp"
#include "isac/explain/slopes.hpp"

namespace isac::explain {
namespace {

/// Rows of the chains asked for, in the order of the data.
std::vector<Eigen::Index> rows_of(const Prepared& data, unsigned chains) {
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < data.rows.size(); ++i)
    if ((bit(data.rows[i].chain) & chains) != 0) rows.push_back(static_cast<Eigen::Index>(i));
  return rows;
}

class FittedRows final : public ceres::CostFunction {
 public:
  FittedRows(const Predictor& predictor, ModelPoint model, std::vector<Coordinate> coordinates,
             const Weights& weights, unsigned chains)
      : predictor_(predictor),
        model_(std::move(model)),
        coordinates_(std::move(coordinates)),
        weights_(weights),
        chains_(chains),
        rows_(rows_of(predictor.data(), chains)) {
    set_num_residuals(static_cast<int>(rows_.size()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(coordinates_.size()));
  }

  bool at(const Eigen::VectorXd& x, Eigen::VectorXd& residual, Eigen::MatrixXd* jacobian) const {
    ModelPoint model = model_;
    for (std::size_t j = 0; j < coordinates_.size(); ++j)
      set_value(model, coordinates_[j], x[static_cast<Eigen::Index>(j)] * coordinates_[j].scale);
    Eigen::VectorXd here = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(predictor_.rows()));
    predictor_.predict(model, chains_, here);
    const auto n = static_cast<Eigen::Index>(rows_.size());
    residual.resize(n);
    Eigen::VectorXd column = here - predictor_.measured();
    weigh(predictor_.data(), weights_, column);
    for (Eigen::Index i = 0; i < n; ++i) residual[i] = column[rows_[static_cast<std::size_t>(i)]];
    if (!residual.allFinite()) return false;
    if (jacobian == nullptr) return true;
    std::vector<double> values;
    for (std::size_t j = 0; j < coordinates_.size(); ++j)
      values.push_back(x[static_cast<Eigen::Index>(j)] * coordinates_[j].scale);
    const Eigen::MatrixXd slopes = slopes_of(predictor_, model, here, weights_, coordinates_, values);
    *jacobian = slopes(rows_, Eigen::all);
    return true;
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const auto n = static_cast<Eigen::Index>(rows_.size()),
               m = static_cast<Eigen::Index>(coordinates_.size());
    const bool slopes = jacobians != nullptr && jacobians[0] != nullptr;
    Eigen::VectorXd residual;
    Eigen::MatrixXd jacobian;
    if (!at(Eigen::Map<const Eigen::VectorXd>(parameters[0], m), residual, slopes ? &jacobian : nullptr))
      return false;
    Eigen::Map<Eigen::VectorXd>(residuals, n) = residual;
    if (slopes)
      Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(jacobians[0], n, m) =
          jacobian;
    return true;
  }

 private:
  const Predictor& predictor_;
  ModelPoint model_;
  std::vector<Coordinate> coordinates_;
  const Weights& weights_;
  unsigned chains_;
  std::vector<Eigen::Index> rows_;
};

/// The last steps within the bounds that are not touched; those that are stay held.
void polish(FittedRows& rows, const Eigen::VectorXd& lower, const Eigen::VectorXd& upper,
            Eigen::VectorXd& x) {
  std::vector<int> held;
  for (Eigen::Index j = 0; j < x.size(); ++j)
    if (x[j] <= lower[j] || x[j] >= upper[j]) held.push_back(static_cast<int>(j));
  if (held.size() == static_cast<std::size_t>(x.size())) return;
  ceres::Problem::Options ownership;
  ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(ownership);
  Eigen::VectorXd better = x;
  problem.AddResidualBlock(&rows, nullptr, better.data());
  if (!held.empty())
    problem.SetManifold(better.data(), new ceres::SubsetManifold(static_cast<int>(x.size()), held));
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  options.max_num_iterations = 3;
  options.function_tolerance = 1e-8;
  options.parameter_tolerance = 1e-7;
  options.logging_type = ceres::SILENT;
  options.num_threads = 1;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (summary.IsSolutionUsable() && (better.array() >= lower.array()).all() &&
      (better.array() <= upper.array()).all())
    x = better;
}

/// The model where `x` is, and what it leaves in the rows that were refitted; the others stay.
void move_to(const Predictor& predictor, const Weights& weights, const Eigen::VectorXd& x, Fit& fit) {
  for (std::size_t j = 0; j < fit.coordinates.size(); ++j) {
    const Coordinate& c = fit.coordinates[j];
    set_value(fit.model, c, x[static_cast<Eigen::Index>(j)] * c.scale);
  }
  Eigen::VectorXd prediction = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(predictor.rows()));
  predictor.predict(fit.model, fit.chains, prediction);
  prediction -= predictor.measured();
  weigh(predictor.data(), weights, prediction);
  if (fit.residual.size() == 0) fit.residual = Eigen::VectorXd::Zero(prediction.size());
  for (std::size_t i = 0; i < predictor.rows(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    if ((bit(predictor.data().rows[i].chain) & fit.chains) != 0) fit.residual[k] = prediction[k];
  }
  fit.loss = fit.residual.squaredNorm();
}

struct Bounded {
  Eigen::VectorXd x, lower, upper;
};

Bounded coordinates_of(const Fit& fit) {
  const auto m = static_cast<Eigen::Index>(fit.coordinates.size());
  Bounded b{Eigen::VectorXd(m), Eigen::VectorXd(m), Eigen::VectorXd(m)};
  for (Eigen::Index j = 0; j < m; ++j) {
    const Coordinate& c = fit.coordinates[static_cast<std::size_t>(j)];
    b.lower[j] = c.lower / c.scale;
    b.upper[j] = c.upper / c.scale;
    b.x[j] = fit.value(c) / c.scale;
  }
  return b;
}

void solve(const Predictor& predictor, Fit& fit, const Weights& weights, int rounds) {
  const Bounded start = coordinates_of(fit);
  const FittedRows rows(predictor, fit.model, fit.coordinates, weights, fit.chains);
  const BoundedFit found =
      bounded_fit([&](const Eigen::VectorXd& at, Eigen::VectorXd& residual,
                      Eigen::MatrixXd* jacobian) { return rows.at(at, residual, jacobian); },
                  start.x, start.lower, start.upper, {.rounds = rounds, .tolerance = 1e-7});
  fit.converged = found.converged;
  move_to(predictor, weights, found.x, fit);
}

/// Chains that hang together with those given: through a common parameter, or because the zero that the torque's rows tell of is taken off
/// the motion's.
unsigned closure(unsigned chains, const ModelPoint& model, bool one_zero) {
  const auto with_zero = [&](unsigned c) {
    return one_zero && (c & kForceChains) != 0 ? c | kForceChains : c;
  };
  if ((chains & kPressureChains) != 0) chains |= kPressureChains;
  chains = with_zero(chains);
  for (bool grown = true; grown;) {
    grown = false;
    for (const Active& a : model.effects) {
      const unsigned c = a.hypothesis->chains;
      if ((c & chains) != 0 && (c & ~chains) != 0) {
        chains = with_zero(chains | c);
        grown = true;
      }
    }
    if ((chains & kPressureChains) != 0) chains |= kPressureChains;
  }
  return chains;
}

/// Calls `work` for each set of chains that hang together, `fit` being of these alone: what shares no parameter is fitted by itself, as far as its own
/// rows tell.
template <class Work>
void by_themselves(Fit& fit, const Weights& weights, const Work& work) {
  const unsigned all = fit.chains;
  const std::vector<Coordinate> coordinates = std::move(fit.coordinates);
  bool converged = true;
  for (unsigned left = all, together = 0; left != 0; left &= ~together) {
    together = closure(left & (~left + 1), fit.model, weights.one_zero) & all;
    fit.chains = together;
    fit.coordinates.clear();
    std::copy_if(coordinates.begin(), coordinates.end(), std::back_inserter(fit.coordinates),
                 [&](const Coordinate& c) { return (c.chains & together) != 0; });
    work();
    converged = converged && fit.converged;
  }
  fit.chains = all;
  fit.coordinates = coordinates;
  fit.converged = converged;
}

}  // namespace

double Fit::value(const Coordinate& c) const {
  if (c.rest >= 0) return model.rest[static_cast<std::size_t>(c.rest)];
  return c.base >= 0 ? model.base[static_cast<std::size_t>(c.base)]
                     : model.effects[static_cast<std::size_t>(c.effect)]
                           .values[static_cast<std::size_t>(c.component)];
}

Fit fit_baseline(const Predictor& predictor, const std::vector<Hypothesis>& tolerances,
                 const Weights& weights, bool resting_angles) {
  Fit fit;
  for (const BaseParameter& b : predictor.base()) fit.model.base.push_back(b.start);
  for (const Hypothesis& h : tolerances) {
    Active a;
    a.hypothesis = &h;
    fit.model.effects.push_back(a);
  }
  fit.tolerances = tolerances.size();
  add_base(predictor, fit.model, kAllChains, fit.coordinates);
  for (std::size_t i = 0; i < tolerances.size(); ++i)
    fit.coordinates.push_back(effect_coordinate(fit.model.effects[i], static_cast<int>(i), 0, true));
  if (resting_angles) add_rest(predictor, fit.model, kAllChains, fit.coordinates);
  by_themselves(fit, weights, [&] { solve(predictor, fit, weights, 30); });
  return fit;
}

Fit refit(const Predictor& predictor, const Fit& start, const std::vector<Active>& effects,
          const Weights& weights, int iterations) {
  Fit fit;
  fit.model = start.model;
  fit.tolerances = start.tolerances;
  fit.residual = start.residual;
  unsigned chains = 0;
  for (const Active& a : effects) {
    // An effect that is also a tolerance takes its place.
    for (std::size_t i = 0; i < fit.tolerances; ++i)
      if (fit.model.effects[i].hypothesis->effect == a.hypothesis->effect) fit.model.effects[i].values = {};
    fit.model.effects.push_back(a);
    chains |= a.hypothesis->chains;
  }
  fit.chains = closure(chains, fit.model, weights.one_zero);
  add_base(predictor, fit.model, fit.chains, fit.coordinates);
  add_rest(predictor, fit.model, fit.chains, fit.coordinates);
  add_effects(fit.model, fit.tolerances, fit.chains, fit.coordinates);
  by_themselves(fit, weights, [&] { solve(predictor, fit, weights, iterations); });
  return fit;
}

Fit polished(const Predictor& predictor, Fit fit, const Weights& weights) {
  by_themselves(fit, weights, [&] {
    Bounded at = coordinates_of(fit);
    FittedRows rows(predictor, fit.model, fit.coordinates, weights, fit.chains);
    polish(rows, at.lower, at.upper, at.x);
    move_to(predictor, weights, at.x, fit);
  });
  return fit;
}

Fit beside_other_runs(const Predictor& predictor, const Fit& fit, ModelPoint model,
                      Eigen::VectorXd residual) {
  Fit there;
  there.model = std::move(model);
  there.tolerances = fit.tolerances;
  std::copy_if(fit.coordinates.begin(), fit.coordinates.end(), std::back_inserter(there.coordinates),
               [](const Coordinate& c) { return c.rest < 0; });
  if (std::any_of(fit.coordinates.begin(), fit.coordinates.end(),
                  [](const Coordinate& c) { return c.rest >= 0; }))
    add_rest(predictor, there.model, kAllChains, there.coordinates);
  there.loss = residual.squaredNorm();
  there.residual = std::move(residual);
  there.converged = fit.converged;
  return there;
}

}  // namespace isac::explain
