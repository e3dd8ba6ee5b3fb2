#include "isac/explain/candidates.hpp"

#include <algorithm>
#include <string>
#include <utility>

#include "isac/explain/kinship.hpp"
#include "isac/explain/labels.hpp"
#include "isac/explain/ranking.hpp"

namespace isac::explain {

Candidate candidate_of(const Library& library, const Trial& trial, double confidence) {
  const Hypothesis& h = library.hypotheses[static_cast<std::size_t>(trial.hypothesis)];
  Candidate c;
  c.id = h.id();
  c.form = h.info().id;
  c.name = h.info().term;
  c.subsystem = subsystem_name(h.info().where);
  c.equation = h.info().equation;
  c.confidence = confidence;
  c.behind_best = told_behind(trial.behind);
  for (int i = 0; i < h.info().parameter_count; ++i) {
    const auto& p = h.info().parameters[i];
    Estimated e;
    e.name = p.name;
    e.unit = p.unit;
    e.value = trial.values[static_cast<std::size_t>(i)] / p.si_per_unit;
    c.parameters.push_back(e);
  }
  return c;
}

void keep_simple_case(const Library& library, std::vector<Trial> trials, std::size_t added, Explanation& e) {
  constexpr double kThreeSigma = 3;
  const auto id_of = [&](const Trial& t) {
    return library.hypotheses[static_cast<std::size_t>(t.hypothesis)].id();
  };
  const std::string general = id_of(trials.front());
  std::vector<std::string> kept;
  for (Trial& t : trials)
    if (!t.in_set && nests(general, id_of(t)) && t.behind.t < kThreeSigma) {
      t.in_set = true;
      kept.push_back(id_of(t));
    }
  if (kept.empty()) return;
  Ranking::weigh(trials);
  e.effects[added].confidence = trials.front().weight;
  for (const Trial& t : trials)
    for (Candidate& c : e.alternatives)
      if (t.in_set && c.id == id_of(t)) c.confidence = t.weight;
  for (const Trial& t : trials)
    if (std::find(kept.begin(), kept.end(), id_of(t)) != kept.end()) {
      std::erase_if(e.rejected, [&](const Candidate& c) { return c.id == id_of(t); });
      e.alternatives.push_back(candidate_of(library, t, t.weight));
    }
}

void keep_general_cases(const Library& library, const std::vector<Trial>& trials, std::size_t added,
                        Explanation& e) {
  // Of 124 faint effects that were told by a name which has a general case five were that one.
  constexpr double kOneInTwenty = 0.05, kNoWorse = 0.5;
  constexpr std::size_t kMost = 2;
  Candidate& named = e.effects[added];
  const auto id_of = [&](const Trial& t) {
    return library.hypotheses[static_cast<std::size_t>(t.hypothesis)].id();
  };
  const auto is_told = [&](const std::string& id) {
    const auto is = [&](const Candidate& c) { return c.id == id; };
    return std::any_of(e.effects.begin(), e.effects.end(), is) ||
           std::any_of(e.alternatives.begin(), e.alternatives.end(), is);
  };
  std::vector<const Trial*> general;
  for (const Trial& t : trials)
    if (t.behind.t < kNoWorse && nests(id_of(t), named.id) && !is_told(id_of(t))) general.push_back(&t);
  std::stable_sort(general.begin(), general.end(),
                   [](const Trial* a, const Trial* b) { return a->behind.t < b->behind.t; });
  if (general.size() > kMost) general.resize(kMost);
  const double share = kOneInTwenty * named.confidence;
  for (const Trial* t : general) {
    Candidate c = candidate_of(library, *t, share);
    std::erase_if(e.rejected, [&](const Candidate& r) { return r.id == c.id; });
    e.alternatives.push_back(std::move(c));
    named.confidence -= share;
  }
}

void keep_what_both_are(const Library& library, const Found& found, Explanation& e) {
  constexpr double kOneInThree = 1.0 / 3;  // chosen, not measured
  const std::string both = "asymmetric_hysteresis";
  const auto is = [&](const Candidate& c) { return c.id == both; };
  const auto loop = std::find_if(e.effects.begin(), e.effects.end(), [&](const Candidate& c) {
    return std::any_of(e.effects.begin(), e.effects.end(), [&](const Candidate& other) {
      return c.id == "hysteresis" && is_a_loop_with_an_offset(c.id, other.id);
    });
  });
  const auto general = std::find_if(library.hypotheses.begin(), library.hypotheses.end(),
                                    [&](const Hypothesis& h) { return h.id() == both; });
  if (loop == e.effects.end() || general == library.hypotheses.end() ||
      std::any_of(e.alternatives.begin(), e.alternatives.end(), is))
    return;
  const std::vector<Trial>& trials = found.steps[static_cast<std::size_t>(loop - e.effects.begin())].trials;
  const auto refitted = std::find_if(trials.begin(), trials.end(), [&](const Trial& t) {
    return library.hypotheses[static_cast<std::size_t>(t.hypothesis)].id() == both;
  });
  Trial by_equation;  // nothing behind: with one width it is what was added
  by_equation.hypothesis = static_cast<int>(general - library.hypotheses.begin());
  Candidate c = candidate_of(library, refitted != trials.end() ? *refitted : by_equation,
                             kOneInThree * loop->confidence);
  if (refitted == trials.end()) c.parameters.clear();
  std::erase_if(e.rejected, is);
  loop->confidence -= c.confidence;
  e.alternatives.push_back(std::move(c));
}

}  // namespace isac::explain
