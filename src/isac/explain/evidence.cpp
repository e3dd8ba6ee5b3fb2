#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "isac/explain/describe.hpp"
#include "isac/explain/labels.hpp"
#include "isac/explain/taken_out.hpp"
#include "isac/explain/where.hpp"

namespace isac::explain {
namespace {

/// Chain in which a weight sits most.
Chain chain_of(const Prepared& data, const Eigen::VectorXd& weight) {
  double sum[kChains] = {};
  for (std::size_t i = 0; i < data.rows.size(); ++i)
    sum[static_cast<int>(data.rows[i].chain)] += weight[static_cast<Eigen::Index>(i)];
  return static_cast<Chain>(std::max_element(sum, sum + kChains) - sum);
}

std::string share_in_words(const Region& r) {
  return fmt::format("{:.0f} % of it sits {}", 100 * r.share, in_words(r));
}

/// Half the width of the loop that a residual makes over the direction of motion, below and above the middle of `by`.
struct Width {
  double low = kNotKnown, high = kNotKnown, middle = kNotKnown;
};

template <class Value>
Width loop_width(const Prepared& data, const Eigen::VectorXd& left, Chain chain, Value&& by) {
  std::vector<std::pair<double, double>> points;
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const Row& row = data.rows[i];
    const PreparedRun& run = data.runs[row.run];
    if (row.chain != chain || run.angle.empty() || run.dry_velocity[row.sample] == 0) continue;
    const double sign = run.dry_velocity[row.sample] > 0 ? 1 : -1;
    points.emplace_back(by(run, row.sample), -sign * left[static_cast<Eigen::Index>(i)]);
  }
  Width w;
  if (points.size() < 200) return w;
  std::sort(points.begin(), points.end());
  const std::size_t half = points.size() / 2, third = points.size() / 3;
  w.middle = points[half].first;
  const auto mean = [&](std::size_t from, std::size_t to) {
    double sum = 0;
    for (std::size_t i = from; i < to; ++i) sum += points[i].second;
    return sum / static_cast<double>(to - from);
  };
  w.low = mean(0, third);
  w.high = mean(points.size() - third, points.size());
  return w;
}

/// Fingerprints of explain's key that can be measured: how the loop's width goes with speed and with mean pressure.
void add_widths(const Predictor& predictor, const Eigen::VectorXd& left, Chain chain, Candidate& c) {
  const Prepared& data = predictor.data();
  const Label label = label_of(data, chain);
  const auto say = [&](const Width& w, const char* variable) {
    if (!std::isfinite(w.low)) return;
    const double low = std::abs(w.low), high = std::abs(w.high), change = (high - low) / std::max(low, high);
    c.evidence.push_back(
        {true,
         fmt::format("Without it the residual makes a loop over the direction of motion, {} {} wide on "
                     "either side in the third of the rows with the lowest {}, {} in the third with the "
                     "highest: {}.",
                     rounded(low * label.scale, 2), label.unit, variable, rounded(high * label.scale, 2),
                     change > 0.25    ? "it grows"
                     : change < -0.25 ? "it shrinks"
                                      : "it stays")});
  };
  say(loop_width(data, left, chain,
                 [](const PreparedRun& run, std::size_t k) { return std::abs(run.velocity[k]); }),
      "speed");
  if (data.baseline.terms.empty())
    say(loop_width(data, left, chain,
                   [](const PreparedRun& run, std::size_t k) {
                     return run.has_pressure ? 0.5 * (run.pressure[0][k] + run.pressure[1][k]) : 0.0;
                   }),
        "mean pressure");
}

bool is_friction(int effect) {
  const std::string_view family = family_of(effect);
  return family == "rate-independent dissipation" || family == "viscous damping";
}

struct Place {
  const Step* step = nullptr;
  const Trial* trial = nullptr;
};

/// The trial that a candidate was made of: the first of its id with the same standing.
Place place_of(const Library& library, const Found& found, const Candidate& c, bool in_set) {
  for (const Step& step : found.steps)
    for (const Trial& t : step.trials)
      if (&t != &step.trials.front() && t.in_set == in_set &&
          library.hypotheses[static_cast<std::size_t>(t.hypothesis)].id() == c.id &&
          std::abs(told_behind(t.behind) - c.behind_best) <= 1e-9 * (1 + std::abs(c.behind_best)))
        return {&step, &t};
  return {};
}

/// Where a rival fails against the best: "61 % of the surplus sits at …".
std::string where_it_fails(const Prepared& data, const Trial& best, const Trial& rival) {
  const Eigen::VectorXd surplus = rival.residual.array().square() - best.residual.array().square();
  const std::vector<Region> found = regions_of(data, chain_of(data, surplus), surplus);
  return found.empty() ? ""
                       : fmt::format("{:.0f} % of what it misses more sits {}", 100 * found.front().share,
                                     in_words(found.front()));
}

double closes(const Found& found, const Step& step, const Trial& trial) {
  const double explainable = found.baseline.loss - found.model.loss;
  if (explainable <= 0) return kNotKnown;
  double before = found.baseline.loss;
  for (const Step& s : found.steps) {
    if (&s == &step) break;
    if (!s.trials.empty()) before = s.trials.front().loss;
  }
  return std::clamp((before - trial.loss) / explainable, 0.0, 1.0);
}

void evidence_of_added(const Predictor& predictor, const Library& library, const Found& found,
                       std::size_t index, Candidate& c) {
  const Prepared& data = predictor.data();
  const Step& step = found.steps[index];
  const Trial& best = step.trials.front();
  const Hypothesis& h = library.hypotheses[static_cast<std::size_t>(best.hypothesis)];
  c.closes = closes(found, step, best);
  const TakenOut without = taken_out(predictor, found, index);
  c.evidence.push_back(
      {true,
       fmt::format(
           "A model fitted without it misses {} sigma of data; what it adds is {} times the noise floor.",
           rounded(c.missed_by, 3), rounded(best.material, 2))});
  if (!c.parameters.empty() && c.parameters.front().std_error > 0) {
    const Estimated& p = c.parameters.front();
    const double null = h.info().parameters[0].null_value / h.info().parameters[0].si_per_unit;
    if (std::isfinite(null))
      c.evidence.push_back({true, fmt::format("{}: {} standard errors from its absence.",
                                              with_error(p.name, p.value, p.std_error, p.unit),
                                              rounded(std::abs(p.value - null) / p.std_error, 2))});
  }
  const Chain chain = chain_of(data, without.gain);
  const std::vector<Region> at = regions_of(data, chain, without.gain);
  if (!at.empty())
    c.evidence.push_back({true, fmt::format("Its part in the {} is where the disagreement is: {}.",
                                            label_of(data, chain).signal, share_in_words(at.front()))});
  if (is_friction(h.effect) && (chain == Chain::kTorque || chain == Chain::kMotion))
    add_widths(predictor, without.left, chain, c);
  // The nearest rival, and what told it apart.
  for (std::size_t i = 1; i < step.trials.size(); ++i) {
    const Trial& t = step.trials[i];
    const auto& rival = library.hypotheses[static_cast<std::size_t>(t.hypothesis)].info();
    if (t.in_set) {
      c.evidence.push_back(
          {false, fmt::format("{} {}; {} sigma of data lie between them. What would tell: {}.", rival.term,
                              how_much_worse(told_behind(t.behind)), rounded(t.behind.separation, 2),
                              h.info().told_apart_by)});
      continue;
    }
    if (nests(rival.id, h.info().id)) {
      c.evidence.push_back(
          {true, fmt::format("Its general case, {}, fits no better than further numbers make it: the simpler "
                             "one stands.",
                             rival.term)});
      continue;
    }
    const std::string fails = where_it_fails(data, best, t);
    c.evidence.push_back(
        {true, fmt::format("It is told from {} ({}) by {} sigma{}.", rival.term, h.info().told_apart_by,
                           rounded(told_behind(t.behind), 2), fails.empty() ? "" : "; " + fails)});
    break;
  }
}

void evidence_of_rival(const Predictor& predictor, const Library& library, const Found& found, bool in_set,
                       Candidate& c) {
  const Place place = place_of(library, found, c, in_set);
  if (place.trial == nullptr) return;
  const Trial& best = place.step->trials.front();
  const auto& winner = library.hypotheses[static_cast<std::size_t>(best.hypothesis)].info();
  const auto& own = library.hypotheses[static_cast<std::size_t>(place.trial->hypothesis)].info();
  c.closes = closes(found, *place.step, *place.trial);
  const std::string fails = where_it_fails(predictor.data(), best, *place.trial);
  if (in_set) {
    c.evidence.push_back(
        {true, fmt::format("Beside {} it {}; {} sigma of data lie between their predictions. What would "
                           "tell: {}.",
                           winner.term, how_much_worse(told_behind(place.trial->behind)),
                           rounded(place.trial->behind.separation, 2), own.told_apart_by)});
  } else {
    c.evidence.push_back(
        {false, nests(own.id, winner.id)
                    ? fmt::format("Its special case, {}, says as much with fewer numbers.", winner.term)
                    : fmt::format("It fits {} sigma worse than {}.",
                                  rounded(told_behind(place.trial->behind), 2), winner.term)});
  }
  if (!fails.empty()) c.evidence.push_back({false, fmt::format("Where it falls short: {}.", fails)});
}

}  // namespace

void add_evidence(const Predictor& predictor, const Library& library, const Found& found, Explanation& e) {
  for (std::size_t i = 0; i < found.added.size() && i < e.effects.size(); ++i)
    evidence_of_added(predictor, library, found, i, e.effects[i]);
  for (Candidate& c : e.alternatives) evidence_of_rival(predictor, library, found, true, c);
  for (Candidate& c : e.rejected) evidence_of_rival(predictor, library, found, false, c);
}

}  // namespace isac::explain
