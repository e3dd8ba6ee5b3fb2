// What an effect adds to the rows of a fit, as it is and weighted.
#include "isac/explain/fit.hpp"

namespace isac::explain {

Eigen::VectorXd change(const Predictor& predictor, const Fit& fit, const Eigen::VectorXd& here,
                       const Active& effect) {
  Eigen::VectorXd change;
  if (predictor.adds_up(fit.model, *effect.hypothesis)) {
    change = Eigen::VectorXd::Zero(here.size());
    predictor.predict_addition(fit.model, effect, change);
  } else {
    change = here;
    ModelPoint with = fit.model;
    with.effects.push_back(effect);
    predictor.predict(with, effect.hypothesis->chains, change);
    change -= here;
  }
  return change;
}

Eigen::VectorXd response(const Predictor& predictor, const Fit& fit, const Eigen::VectorXd& here,
                         const Active& effect, const Weights& weights) {
  Eigen::VectorXd rows = change(predictor, fit, here, effect);
  weigh(predictor.data(), weights, rows);
  return rows;
}

}  // namespace isac::explain
