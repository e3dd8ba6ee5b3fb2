#include "isac/explain/slip_moment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "isac/explain/compare.hpp"

namespace isac::explain {
namespace {

constexpr double kBefore = 0.5;  // s before a run begins
constexpr double kPause = 60;    // s: nobody asks for less, between two runs
constexpr int kIterations = 8;
constexpr std::size_t kMoment = 1;  // of the values of a slip: s, t_s

/// Where among the effects of the model a slip stands that happens once in a day; none: their number.
std::size_t slip_of(const Found& found) {
  const std::vector<Active>& effects = found.model.model.effects;
  const auto slip =
      std::find_if(effects.begin() + static_cast<std::ptrdiff_t>(found.model.tolerances), effects.end(),
                   [](const Active& a) {
                     return a.hypothesis->id() == "encoder_slip" && a.hypothesis->clock == Clock::kDay;
                   });
  return static_cast<std::size_t>(slip - effects.begin());
}

Fit with_slip_at(const Predictor& predictor, const Found& found, std::size_t slip, double moment) {
  std::vector<Active> effects(
      found.model.model.effects.begin() + static_cast<std::ptrdiff_t>(found.model.tolerances),
      found.model.model.effects.end());
  effects[slip - found.model.tolerances].values[kMoment] = moment;
  return refit(predictor, found.baseline, effects, found.weights, kIterations);
}

/// Moments that are one to the fitted runs and not to the held-out ones: each of those in the same pause was recorded before or after.
std::vector<double> same_to_fitted(const Prepared& data, const std::vector<Proof::Span>& heldout,
                                   double moment) {
  double low = -INFINITY, high = INFINITY;  // ends of the pause
  for (const PreparedRun& run : data.runs) {
    if (run.time.empty()) continue;
    const double begin = run.day_offset, end = begin + run.time.back();
    if (moment > begin && moment < end) return {moment};
    if (end <= moment) low = std::max(low, end);
    if (begin >= moment) high = std::min(high, begin);
  }
  std::vector<double> moments{moment};
  for (const Proof::Span& run : heldout)
    if (run.begin > low && run.begin < high) moments.push_back(run.begin - kBefore);
  if (std::isfinite(high)) moments.push_back(high - kBefore);
  return moments;
}

/// The model with its slip at every other moment that the fitted rows do not rule out.
std::vector<Fit> as_good_at_other_moments(const Predictor& predictor, const Library& library,
                                          const Found& found, std::size_t slip,
                                          const std::vector<Proof::Span>& heldout) {
  const Active& named = found.model.model.effects[slip];
  const double was = named.values[kMoment];
  std::set<double> moments{was};
  for (const Hypothesis& h : library.hypotheses)
    if (h.effect == named.hypothesis->effect && h.clock == Clock::kDay)
      for (const Values& shape : h.shapes) moments.insert(shape[kMoment]);
  const NoiseDensity noise = noise_density(predictor.data(), found.model.residual);
  std::vector<Fit> as_good;
  std::set<double> had{was};
  for (const double moment : moments) {
    const Fit fit = moment == was ? found.model : with_slip_at(predictor, found, slip, moment);
    if (compare(predictor.data(), found.model.residual, fit.residual, 0, noise).t >= kSetLimit) continue;
    for (const double same : same_to_fitted(predictor.data(), heldout, moment)) {
      if (!had.insert(same).second) continue;
      as_good.push_back(fit);
      as_good.back().model.effects[slip].values[kMoment] = same;
    }
  }
  return as_good;
}

}  // namespace

std::string settle_slip(const Predictor& predictor, const Library& library, const Proof& proof,
                        Found& found) {
  const std::size_t slip = slip_of(found);
  const std::vector<Proof::Span> heldout = proof.spans();
  if (slip == found.model.model.effects.size() || heldout.empty()) return "";
  const auto moment_of = [&](const Fit& fit) { return fit.model.effects[slip].values[kMoment]; };
  const double was = moment_of(found.model);
  std::vector<Fit> open = as_good_at_other_moments(predictor, library, found, slip, heldout);
  const auto ahead = [&](const Fit& a, const Fit& b) {
    return proof.freed(a.model, b.model, found.weights, Chain::kTorque).behind.t;
  };
  for (const Fit& fit : open)
    if (ahead(fit, found.model) > kSetLimit) found.model = fit;
  const double at = moment_of(found.model);
  double first = at, last = at;
  for (const Fit& fit : open)
    if (ahead(found.model, fit) <= kSetLimit) {
      first = std::min(first, moment_of(fit));
      last = std::max(last, moment_of(fit));
    }
  // What was recorded last before the first of these moments was recorded before the slip.
  double before = -INFINITY;
  const auto ended = [&](double end) {
    if (end <= first) before = std::max(before, end);
  };
  for (const Proof::Span& run : heldout) ended(run.end);
  for (const PreparedRun& run : predictor.data().runs)
    if (!run.time.empty()) ended(run.day_offset + run.time.back());
  first = std::isfinite(before) ? before : first;
  std::string told;
  if (at != was)
    told = fmt::format(
        "The fitted runs leave open whether it slipped at {:.0f} s or at {:.0f} s; the held-out runs "
        "decided.",
        was, at);
  if (last - first > kPause)
    told += fmt::format("{}Between {:.0f} s and {:.0f} s no run tells when it slipped.",
                        told.empty() ? "" : " ", first, last);
  return told;
}

}  // namespace isac::explain
