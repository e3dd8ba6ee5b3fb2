#include "isac/explain/slopes.hpp"

#include <algorithm>
#include <cmath>

#include "isac/explain/fit.hpp"
#include "isac/explain/workers.hpp"

namespace isac::explain {
namespace {

constexpr double kDifference = 1e-4;  // of a coordinate's scale

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
  set_value(there, c, value + step);
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

}  // namespace

Eigen::MatrixXd slopes_of(const Predictor& predictor, const ModelPoint& model, const Eigen::VectorXd& here,
                          const Weights& weights, const std::vector<Coordinate>& coordinates,
                          const std::vector<double>& values) {
  Eigen::MatrixXd slopes(here.size(), static_cast<Eigen::Index>(coordinates.size()));
  share_work(predictor.threads(), coordinates.size(), [&](std::size_t j) {
    Eigen::VectorXd column;
    slope_of(predictor, model, here, coordinates[j], values[j], column);
    slopes.col(static_cast<Eigen::Index>(j)) = column;
  });
  weigh(predictor.data(), weights, slopes, predictor.threads());
  return slopes;
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
    std::vector<double> values;
    for (const Coordinate& c : coordinates) values.push_back(fit.value(c));
    return slopes_of(predictor, fit.model, here, weights, coordinates, values);
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
