#include "isac/explain/slip_moment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "isac/explain/compare.hpp"

namespace isac::explain {
namespace {

constexpr double kBeforeARun = 0.5;  // s before a run begins
constexpr double kLongPause = 60;    // s: nobody asks for less, between two runs
constexpr int kSlipIterations = 8;
constexpr double kClearlyASlip = 3;  // sigma, of held-out rows, for another name than the fitted ones had

/// Where both are the same there is no t.
bool leaves_open(const Comparison& c) {
  return !(c.t > kSetLimit) || c.separation < kTwinLimit;
}

/// Where among the effects of the model a slip stands that happens once in a day; none: their number.
std::size_t slip_of(const Found& found) {
  const std::vector<Active>& effects = found.model.model.effects;
  const auto slip = std::find_if(effects.begin() + static_cast<std::ptrdiff_t>(found.model.tolerances),
                                 effects.end(), [](const Active& a) { return is_slip(*a.hypothesis); });
  return static_cast<std::size_t>(slip - effects.begin());
}

Fit with_slip_at(const Predictor& predictor, const Found& found, std::size_t slip, double moment) {
  std::vector<Active> effects(
      found.model.model.effects.begin() + static_cast<std::ptrdiff_t>(found.model.tolerances),
      found.model.model.effects.end());
  effects[slip - found.model.tolerances].values[kSlipMoment] = moment;
  return refit(predictor, found.baseline, effects, found.weights, kSlipIterations);
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
    if (run.begin > low && run.begin < high) moments.push_back(run.begin - kBeforeARun);
  if (std::isfinite(high)) moments.push_back(high - kBeforeARun);
  return moments;
}

/// The model with its slip at every other moment that the fitted rows do not rule out.
std::vector<Fit> as_good_at_other_moments(const Predictor& predictor, const Library& library,
                                          const Found& found, std::size_t slip,
                                          const std::vector<Proof::Span>& heldout) {
  const Active& named = found.model.model.effects[slip];
  const double was = named.values[kSlipMoment];
  std::set<double> moments{was};
  for (const Hypothesis& h : library.hypotheses)
    if (h.effect == named.hypothesis->effect && h.clock == Clock::kDay)
      for (const Values& shape : h.shapes) moments.insert(shape[kSlipMoment]);
  const NoiseDensity noise = noise_density(predictor.data(), found.model.residual);
  std::vector<Fit> as_good;
  std::set<double> had{was};
  for (const double moment : moments) {
    const Fit fit = moment == was ? found.model : with_slip_at(predictor, found, slip, moment);
    if (compare(predictor.data(), found.model.residual, fit.residual, 0, noise).t >= kSetLimit) continue;
    for (const double same : same_to_fitted(predictor.data(), heldout, moment)) {
      if (!had.insert(same).second) continue;
      as_good.push_back(fit);
      as_good.back().model.effects[slip].values[kSlipMoment] = same;
    }
  }
  return as_good;
}

}  // namespace

bool is_slip(const Hypothesis& h) {
  return h.id() == "encoder_slip" && h.clock == Clock::kDay;
}

void place_slip(Library& library, const Prepared& data, const Eigen::VectorXd& residual) {
  struct Point {
    double time = 0, value = 0;
    bool inside = false;
  };
  constexpr double kFromEnds = 1.0;  // s
  std::vector<Point> points;
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    if (data.rows[i].chain != Chain::kTorque) continue;
    const PreparedRun& run = data.runs[data.rows[i].run];
    const double t = run.time[data.rows[i].sample];
    points.push_back({run.day_offset + t, residual[static_cast<Eigen::Index>(i)],
                      t > kFromEnds && t < run.time.back() - kFromEnds});
  }
  if (points.size() < 100) return;
  std::stable_sort(points.begin(), points.end(),
                   [](const Point& a, const Point& b) { return a.time < b.time; });
  double mean = 0;
  for (const Point& p : points) mean += p.value / static_cast<double>(points.size());
  const auto n = static_cast<double>(points.size());
  double sum = 0, best = 0, at = 0;
  for (std::size_t k = 0; k + 1 < points.size(); ++k) {
    sum += points[k].value - mean;
    const double before = static_cast<double>(k + 1), gain = sum * sum * n / (before * (n - before));
    if (!points[k].inside || gain <= best) continue;
    best = gain;
    at = 0.5 * (points[k].time + points[k + 1].time);
  }
  if (best <= 0) return;
  for (Hypothesis& h : library.hypotheses)
    if (is_slip(h)) h.shapes.push_back({h.info().parameters[0].typical, at});
}

std::string settle_slip(const Predictor& predictor, const Library& library, const Proof& proof,
                        Found& found) {
  const std::size_t slip = slip_of(found);
  const std::vector<Proof::Span> heldout = proof.spans();
  if (slip == found.model.model.effects.size() || heldout.empty()) return "";
  const auto moment_of = [&](const Fit& fit) { return fit.model.effects[slip].values[kSlipMoment]; };
  const double was = moment_of(found.model);
  std::vector<Fit> open = as_good_at_other_moments(predictor, library, found, slip, heldout);
  const auto behind = [&](const Fit& a, const Fit& b) {  // b, in rows that nothing was fitted to
    return proof.freed(a.model, b.model, found.weights, Chain::kTorque).behind;
  };
  for (const Fit& fit : open)
    if (!leaves_open(behind(fit, found.model))) found.model = fit;
  const double at = moment_of(found.model);
  for (std::size_t k = 0; k < found.added.size(); ++k)
    if (is_slip(library.hypotheses[static_cast<std::size_t>(found.added[k])]))
      found.steps[k].trials.front().values[kSlipMoment] = at;
  double first = at, last = at;
  for (const Fit& fit : open)
    if (leaves_open(behind(found.model, fit))) {
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
  if (last - first > kLongPause)
    told += fmt::format("{}Between {:.0f} s and {:.0f} s no run tells when it slipped.",
                        told.empty() ? "" : " ", first, last);
  return told;
}

std::string slip_instead(const Predictor& predictor, const Library& library, const Proof& proof,
                         Found& found) {
  if (found.added.size() != 1 || proof.runs() == 0) return "";
  const std::vector<Trial>& trials = found.steps.front().trials;
  const auto slip = std::find_if(trials.begin() + 1, trials.end(), [&](const Trial& t) {
    return is_slip(library.hypotheses[static_cast<std::size_t>(t.hypothesis)]) && cannot_rule_out(t.behind);
  });
  if (slip == trials.end()) return "";
  const auto refitted = [&](const Trial& t) {
    const Active active{&library.hypotheses[static_cast<std::size_t>(t.hypothesis)], t.values};
    return refit(predictor, found.baseline, {active}, found.weights, kSlipIterations);
  };
  Found other = found;
  other.model = refitted(*slip);
  other.added.front() = slip->hypothesis;
  std::vector<Trial>& order = other.steps.front().trials;
  std::rotate(order.begin(), order.begin() + (slip - trials.begin()),
              order.begin() + (slip - trials.begin()) + 1);
  const std::string moment = settle_slip(predictor, library, proof, other);
  const auto behind = [&](const ModelPoint& model) {
    return proof.freed(other.model.model, model, found.weights, Chain::kTorque).behind;
  };
  const Comparison first = behind(found.model.model);
  if (leaves_open(first) || first.t < kClearlyASlip) return "";
  const std::string instead = library.hypotheses[static_cast<std::size_t>(found.added.front())].info().term;
  for (Trial& t : order) {
    if (&t == &order.front()) {
      t.behind = {};
      t.in_set = true;
    } else if (cannot_rule_out(t.behind)) {
      t.behind = behind(refitted(t).model);
      t.in_set = cannot_rule_out(t.behind);
    }
  }
  Ranking::weigh(order);
  other.model = polished(predictor, std::move(other.model), other.weights);
  found = std::move(other);
  std::string told = fmt::format(
      "The fitted runs cannot tell it from {}; the held-out runs did, by {:.0f} sigma.", instead, first.t);
  return moment.empty() ? told : told + " " + moment;
}

std::string told_by_one_run(const Predictor& predictor, const Proof& proof, const Found& found) {
  const std::size_t slip = slip_of(found);
  if (slip == found.model.model.effects.size()) return "";
  const double at = found.model.model.effects[slip].values[kSlipMoment];
  int before = 0, after = 0;
  bool within = false;
  const auto count = [&](double begin, double end) {
    within = within || (begin < at && at < end);
    ++(end <= at ? before : after);
  };
  for (const PreparedRun& run : predictor.data().runs)
    if (!run.time.empty()) count(run.day_offset + run.time.front(), run.day_offset + run.time.back());
  for (const Proof::Span& run : proof.spans()) count(run.begin, run.end);
  if (within || std::min(before, after) != 1) return "";
  return fmt::format(
      "Only one run was recorded {} it: whatever that run shows by itself would look like a slip.",
      before == 1 ? "before" : "after");
}

}  // namespace isac::explain
