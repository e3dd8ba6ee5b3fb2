#include "isac/explain/fit.hpp"

#include <ceres/cost_function.h>
#include <ceres/manifold.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "isac/explain/bounded_fit.hpp"
#include "isac/explain/workers.hpp"

namespace isac::explain {
namespace {

constexpr double kDifference = 1e-4;  // of a coordinate's scale

void set(ModelPoint& model, const Coordinate& c, double value) {
  if (c.rest >= 0) {
    model.rest[static_cast<std::size_t>(c.rest)] = value;
  } else if (c.base >= 0) {
    model.base[static_cast<std::size_t>(c.base)] = value;
  } else {
    model.effects[static_cast<std::size_t>(c.effect)].values[static_cast<std::size_t>(c.component)] = value;
  }
}

Coordinate effect_coordinate(const Active& active, int effect, int component, bool tolerance) {
  const auto k = static_cast<std::size_t>(component);
  const Hypothesis& h = *active.hypothesis;
  Coordinate c;
  c.effect = effect;
  c.component = component;
  c.lower = h.lower[k];
  c.upper = h.upper[k];
  const auto& info = h.info().parameters[component];
  c.scale =
      tolerance ? 0.5 * (c.upper - c.lower) : std::max(std::abs(info.typical), std::abs(active.values[k]));
  if (!(c.scale > 0)) c.scale = 1;
  c.chains = h.chains;
  c.tolerance = tolerance;
  return c;
}

void add_base(const Predictor& predictor, const ModelPoint& model, unsigned chains,
              std::vector<Coordinate>& out) {
  for (std::size_t j = 0; j < predictor.base().size(); ++j) {
    const BaseParameter& b = predictor.base()[j];
    if ((b.chains & chains) == 0) continue;
    Coordinate c;
    c.base = static_cast<int>(j);
    c.lower = b.lower;
    c.upper = b.upper;
    c.scale = std::max(std::abs(b.start), 1e-3 * std::abs(model.base[j]));
    c.chains = b.chains;
    out.push_back(c);
  }
}

/// Where within a step of the encoder each resting run stands.
void add_rest(const Predictor& predictor, ModelPoint& model, unsigned chains, std::vector<Coordinate>& out) {
  if (predictor.resting_runs().empty() || (chains & bit(Chain::kTorque)) == 0) return;
  model.rest.resize(predictor.data().runs.size(), 0.0);
  for (const std::size_t run : predictor.resting_runs()) {
    Coordinate c;
    c.rest = static_cast<int>(run);
    c.upper = predictor.data().rig.angle_step;
    c.lower = -c.upper;
    c.scale = c.upper;
    c.chains = bit(Chain::kTorque);
    c.tolerance = true;
    out.push_back(c);
  }
}

/// Tolerances and effects of the chains; a tolerance whose effect is in the model itself gives way to it.
void add_effects(const ModelPoint& model, std::size_t tolerances, unsigned chains,
                 std::vector<Coordinate>& out) {
  for (std::size_t i = 0; i < model.effects.size(); ++i) {
    const Active& a = model.effects[i];
    if ((a.hypothesis->chains & chains) == 0) continue;
    const bool tolerance = i < tolerances;
    if (tolerance &&
        std::any_of(model.effects.begin() + static_cast<std::ptrdiff_t>(tolerances), model.effects.end(),
                    [&](const Active& other) { return other.hypothesis->effect == a.hypothesis->effect; }))
      continue;
    for (int p = 0; p < a.hypothesis->info().parameter_count; ++p)
      if (tolerance ? p == 0 : a.hypothesis->free[static_cast<std::size_t>(p)])
        out.push_back(effect_coordinate(a, static_cast<int>(i), p, tolerance));
  }
}

/// Rows of the chains asked for, in the order of the data.
std::vector<Eigen::Index> rows_of(const Prepared& data, unsigned chains) {
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < data.rows.size(); ++i)
    if ((bit(data.rows[i].chain) & chains) != 0) rows.push_back(static_cast<Eigen::Index>(i));
  return rows;
}

/// A reading of a force that is shifted is linear in the baseline still.
bool bends_force(const ModelPoint& model) {
  return std::any_of(model.effects.begin(), model.effects.end(), [](const Active& a) {
    return a.hypothesis->reads_force && !a.hypothesis->shifts_force;
  });
}

/// Derivative of all rows by one coordinate; other chains' rows are left as they are.
void differentiate(const Predictor& predictor, const ModelPoint& model, const Eigen::VectorXd& here,
                   const Coordinate& c, double value, Eigen::VectorXd& out) {
  ModelPoint there = model;
  if (c.rest >= 0) {
    const Prepared& data = predictor.data();
    const auto run = static_cast<std::size_t>(c.rest);
    out.setZero();
    for (std::size_t i = data.run_begin[run]; i < data.run_begin[run + 1]; ++i)
      if (data.rows[i].chain == Chain::kTorque)
        out[static_cast<Eigen::Index>(i)] = predictor.stiffness(model);
    return;
  }
  if (c.base >= 0 && (c.chains & kPressureChains) == 0 && !bends_force(model)) {
    // Linear: the prediction of a baseline that consists of this term alone.
    std::fill(there.base.begin(), there.base.begin() + static_cast<std::ptrdiff_t>(there.base.size()), 0.0);
    for (std::size_t j = 0; j < there.base.size(); ++j)
      if ((predictor.base()[j].chains & kPressureChains) != 0) there.base[j] = model.base[j];
    there.base[static_cast<std::size_t>(c.base)] = c.scale;
    there.rest.clear();
    std::erase_if(there.effects, [](const Active& a) {
      return !(a.hypothesis->reads_angle || a.hypothesis->reads_pressure ||
               a.hypothesis->info().hook == models::Hook::kMusclePressure);
    });
    predictor.predict(there, c.chains, out);
    out /= c.scale;
    return;
  }
  double step = kDifference * c.scale;
  if (c.effect >= 0 && !c.tolerance) {
    // Events move by whole samples: a step that moves them by less shows nothing.
    const auto& h = *model.effects[static_cast<std::size_t>(c.effect)].hypothesis;
    if (std::isnan(h.info().parameters[c.component].null_value)) step *= 10;
  }
  if (value + step > c.upper) step = -step;
  set(there, c, value + step);
  predictor.predict(there, c.chains, out);
  out = (out - here) / step;
}

/// The same for a step of the coordinate's scale; 0 in the rows that it does not touch.
void slope_of(const Predictor& predictor, const ModelPoint& model, const Eigen::VectorXd& here,
              const Coordinate& c, double value, Eigen::VectorXd& column) {
  column = here;
  differentiate(predictor, model, here, c, value, column);
  for (std::size_t i = 0; i < predictor.rows(); ++i) {
    double& slope = column[static_cast<Eigen::Index>(i)];
    const bool touched = (bit(predictor.data().rows[i].chain) & c.chains) != 0;
    slope = touched && std::isfinite(slope) ? slope * c.scale : 0.0;
  }
}

/// Weighted slopes, a column for each coordinate, whose values are `value(j)`.
template <class Value>
Eigen::MatrixXd slopes_of(const Predictor& predictor, const ModelPoint& model, const Eigen::VectorXd& here,
                          const Weights& weights, const std::vector<Coordinate>& coordinates,
                          const Value& value) {
  Eigen::MatrixXd slopes(here.size(), static_cast<Eigen::Index>(coordinates.size()));
  share_work(predictor.threads(), coordinates.size(), [&](std::size_t j) {
    Eigen::VectorXd column;
    slope_of(predictor, model, here, coordinates[j], value(j), column);
    slopes.col(static_cast<Eigen::Index>(j)) = column;
  });
  weigh(predictor.data(), weights, slopes, predictor.threads());
  return slopes;
}

class Rows final : public ceres::CostFunction {
 public:
  Rows(const Predictor& predictor, ModelPoint model, std::vector<Coordinate> coordinates,
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
      set(model, coordinates_[j], x[static_cast<Eigen::Index>(j)] * coordinates_[j].scale);
    Eigen::VectorXd here = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(predictor_.rows()));
    predictor_.predict(model, chains_, here);
    const auto n = static_cast<Eigen::Index>(rows_.size());
    residual.resize(n);
    Eigen::VectorXd column = here - predictor_.measured();
    weigh(predictor_.data(), weights_, column);
    for (Eigen::Index i = 0; i < n; ++i) residual[i] = column[rows_[static_cast<std::size_t>(i)]];
    if (!residual.allFinite()) return false;
    if (jacobian == nullptr) return true;
    const Eigen::MatrixXd slopes =
        slopes_of(predictor_, model, here, weights_, coordinates_,
                  [&](std::size_t j) { return x[static_cast<Eigen::Index>(j)] * coordinates_[j].scale; });
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
void polish(Rows& rows, const Eigen::VectorXd& lower, const Eigen::VectorXd& upper, Eigen::VectorXd& x) {
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
    set(fit.model, c, x[static_cast<Eigen::Index>(j)] * c.scale);
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
  const Rows rows(predictor, fit.model, fit.coordinates, weights, fit.chains);
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
    Rows rows(predictor, fit.model, fit.coordinates, weights, fit.chains);
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

Eigen::MatrixXd sensitivities(const Predictor& predictor, const Fit& fit, const Weights& weights,
                              std::vector<Coordinate>* used, Held* held) {
  // All chains, also those that the last refit left alone.
  std::vector<Coordinate> all;
  add_base(predictor, fit.model, kAllChains, all);
  {
    ModelPoint ignored = fit.model;
    add_rest(predictor, ignored, kAllChains, all);
  }
  add_effects(fit.model, fit.tolerances, kAllChains, all);
  const auto n = static_cast<Eigen::Index>(predictor.rows());
  Eigen::VectorXd here = Eigen::VectorXd::Zero(n);
  predictor.predict(fit.model, kAllChains, here);
  const auto is_held = [&](const Coordinate& c) {
    const double value = fit.value(c), margin = c.tolerance ? 1e-3 * (c.upper - c.lower) : 0.0;
    return c.base < 0 && (value < c.lower + margin || value > c.upper - margin);
  };
  const auto slopes = [&](const std::vector<Coordinate>& coordinates) {
    return slopes_of(predictor, fit.model, here, weights, coordinates,
                     [&](std::size_t j) { return fit.value(coordinates[j]); });
  };
  std::vector<Coordinate> inside, at_bound;
  for (const Coordinate& c : all) {
    if (!is_held(c)) inside.push_back(c);
    if (is_held(c) && c.tolerance) at_bound.push_back(c);
  }
  if (held != nullptr) {
    held->slopes = slopes(at_bound);
    held->low.resize(held->slopes.cols());
    held->high.resize(held->slopes.cols());
    for (std::size_t j = 0; j < at_bound.size(); ++j) {
      const Coordinate& c = at_bound[j];
      held->low[static_cast<Eigen::Index>(j)] = (c.lower - fit.value(c)) / c.scale;
      held->high[static_cast<Eigen::Index>(j)] = (c.upper - fit.value(c)) / c.scale;
    }
  }
  if (used != nullptr) *used = inside;
  return slopes(inside);
}

}  // namespace isac::explain
