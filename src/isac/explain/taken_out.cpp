#include "isac/explain/taken_out.hpp"

#include <fmt/format.h>

#include <vector>

#include "isac/explain/labels.hpp"

namespace isac::explain {
namespace {

constexpr double kFewSigmaOfData = 33;

}  // namespace

TakenOut taken_out(const Predictor& predictor, const Found& found, std::size_t effect) {
  const Prepared& data = predictor.data();
  ModelPoint model = found.model.model;
  model.effects.erase(model.effects.begin() + static_cast<std::ptrdiff_t>(found.model.tolerances + effect));
  Eigen::VectorXd predicted = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(predictor.rows()));
  predictor.predict(model, kAllChains, predicted);
  TakenOut out;
  out.left = predictor.measured() - predicted;
  Eigen::VectorXd weighted = out.left;
  weigh(data, found.weights, weighted);
  out.gain = weighted.array().square() - found.model.residual.array().square();
  return out;
}

std::vector<Active> others_than(const Found& found, std::size_t effect) {
  std::vector<Active> others(
      found.model.model.effects.begin() + static_cast<std::ptrdiff_t>(found.model.tolerances),
      found.model.model.effects.end());
  others.erase(others.begin() + static_cast<std::ptrdiff_t>(effect));
  return others;
}

double missed_by(const Predictor& predictor, const Found& found, std::size_t effect) {
  const Fit without =
      refit(predictor, found.baseline, others_than(found, effect), found.weights, kRefitIterations);
  return compare(predictor.data(), found.model.residual, without.residual, 0,
                 noise_density(predictor.data(), found.model.residual))
      .separation;
}

bool is_told_by_few_sigma(const Candidate& effect) {
  return effect.missed_by < kFewSigmaOfData;
}

std::string told_by_few_sigma(const std::vector<Candidate>& effects) {
  const Candidate* fewest = nullptr;
  for (const Candidate& c : effects)
    if (c.missed_by < (fewest == nullptr ? kFewSigmaOfData : fewest->missed_by)) fewest = &c;
  if (fewest == nullptr) return "";
  return fmt::format(
      "These recordings hold only {} sigma of it: they cannot tell {} from all that is nearly like it and in "
      "no catalogue.",
      rounded(fewest->missed_by, 2), fewest->name);
}

}  // namespace isac::explain
