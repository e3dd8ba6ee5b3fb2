#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <string_view>
#include <vector>

#include "isac/explain/any_valve.hpp"
#include "isac/explain/constancy.hpp"
#include "isac/explain/end_of_reading.hpp"
#include "isac/explain/generic_fit.hpp"
#include "isac/explain/labels.hpp"
#include "isac/explain/left_over.hpp"
#include "isac/explain/moments.hpp"
#include "isac/explain/search_run.hpp"
#include "isac/explain/slip_moment.hpp"

namespace isac::explain {
namespace {

constexpr double kBeaten = 1.645;  // sigma, by functions without a name
// Sigma more than chance has seldom: were the name right, functions would be half of what lies between the two behind.
constexpr double kCloserThanChance = 1.28;
// Of what a name closes, in units of noise: no equation is truer than that. Of names that functions came close to, a right one on a clear day had 0.003,
// five wrong ones 0.017 and more.
constexpr double kWorthComparing = 0.01;
// Of it, what any valve may have beyond a name without taking it away: 0.00026 beyond a dead time with a limit of the flow. (Functions: kHardlyAny;
// 0.0045 beyond a lag of the force amplifiers that closed 83 sigma beside a wandering zero.)
constexpr double kHardlyAnyOfValve = 0.0005;
constexpr double kAsMuchAsItself = 1, kForSure = 10;  // variation of an effect's size, squared; sigma
constexpr double kGiant = 8;  // of what all effects close together, one by itself: the others take it back
constexpr double kSeldom = 0.005;
// And of all that is significant, where it is not what is most significant: 0.12 had a right name in 107, 0.133 a drift of the encoder for a slip.
constexpr double kWorthDoubtingOfAny = 0.125;
// Of a chain's usual power, in moments that stand out beside a name: of 198 right ones one left more than 0.06, 0.21; a clipped force for a slack muscle
// 0.65.
constexpr double kInMomentsBeside = 0.3;
constexpr double kAtTheEnd = 0.6;  // end_of_reading.hpp
constexpr std::size_t kMany = 3;   // effects at once: one that none of them is may look like that

/// Does the catalogue say that these two are taken for one another?
bool taken_for_one_another(const models::EffectInfo& a, const models::EffectInfo& b) {
  const auto names = [](const models::EffectInfo& effect, std::string_view id) {
    const std::string_view list = effect.confused_with;
    for (std::size_t from = 0; from < list.size();) {
      const std::size_t to = std::min(list.find(", ", from), list.size());
      if (list.substr(from, to - from) == id) return true;
      from = to + 2;
    }
    return false;
  };
  return names(a, b.id) || names(b, a.id);
}

bool is_beaten(const Comparison& behind) {
  return behind.separation >= kTwinLimit && behind.t >= kBeaten;
}

std::string sigma_ahead(const Comparison& behind) {
  return fmt::format("{:.1f} sigma {}", std::abs(behind.t), behind.t > 0 ? "ahead" : "behind");
}

/// What a zero that moved over the day adds to a row: `shape` of it, in the torque, or in the torque and the motion alike or against it, as a zero of
/// the encoder or of the forces does that moved. The best of these, beside which tolerances come back as they do beside a name, takes the place of
/// `best` if it leaves less.
void take_if_less(const Around& place, const std::function<double(const Row&)>& shape, std::size_t function,
                  GenericFit& best) {
  const Prepared& data = place.predictor->data();
  for (const double in_motion : {0.0, 1.0, -1.0}) {
    if (in_motion != 0 && !data.has(Chain::kMotion)) continue;
    Eigen::VectorXd rows = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(data.rows.size()));
    for (std::size_t i = 0; i < data.rows.size(); ++i) {
      if (data.rows[i].chain == Chain::kTorque) rows[static_cast<Eigen::Index>(i)] = shape(data.rows[i]);
      if (data.rows[i].chain == Chain::kMotion)
        rows[static_cast<Eigen::Index>(i)] = in_motion * shape(data.rows[i]);
    }
    weigh(data, *place.weights, rows);
    rows = place.project(rows);
    if (!(rows.norm() > 1e-6)) continue;
    Eigen::VectorXd left = place.left_beside(rows);
    if (left.squaredNorm() >= best.residual.squaredNorm()) continue;
    best.functions = {function};
    best.residual = std::move(left);
  }
  best.gain = place.residual.squaredNorm() - best.residual.squaredNorm();
}

GenericFit nothing_at(const Around& place) {
  return {.chain = Chain::kTorque, .functions = {}, .of_reading = {}, .gain = 0, .residual = place.residual};
}

/// Of all steps between two runs the one that leaves least; its function is the run before which it is.
GenericFit best_step_between_runs(const Around& place) {
  GenericFit best = nothing_at(place);
  for (std::size_t first = 1; first < place.predictor->data().runs.size(); ++first)
    take_if_less(
        place, [&](const Row& row) { return row.run < first ? 0.0 : 1.0; }, first, best);
  return best;
}

/// A drift that is straight over the day.
GenericFit straight_drift(const Around& place) {
  GenericFit best = nothing_at(place);
  const Prepared& data = place.predictor->data();
  constexpr double kHour = 3600;
  take_if_less(
      place,
      [&](const Row& row) {
        return (data.runs[row.run].day_offset + data.runs[row.run].time[row.sample]) / kHour;
      },
      0, best);
  return best;
}

}  // namespace

void Search::hold_against_a_step(const Around& baseline) {
  if (found_.added.size() != 1) return;
  const Trial& named = found_.steps.front().trials.front();
  const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(named.hypothesis)];
  if (h.clock != Clock::kDay || is_slip(h) || !data_.has(Chain::kTorque)) return;
  const GenericFit step = best_step_between_runs(baseline);
  if (step.functions.empty()) return;
  const Comparison behind = behind_generic(data_, named.residual, ranking_.parameters_of(named), step);
  say(fmt::format("{}: a step between two runs is {:.1f} sigma {} ({:.1f} sigma of data between them)",
                  h.id(), std::abs(behind.t), behind.t > 0 ? "ahead" : "behind", behind.separation));
  if (behind.separation < kTwinLimit || behind.t <= kCloserThanChance - 0.5 * behind.separation) return;
  if (behind.t >= kBeaten) {
    found_.notes.push_back(
        {h.id(), fmt::format("ruled out: {:.1f} sigma behind a step between two runs", behind.t)});
    found_.adequate = false;
    return;
  }
  found_.doubts.push_back(fmt::format(
      "It may have happened at once: a step before {} does as well, or nearly ({:.1f} sigma {}, where {:.1f} "
      "sigma of data lie between).",
      data_.runs[step.functions.front()].name, std::abs(behind.t), behind.t > 0 ? "ahead" : "behind",
      behind.separation));
}

void Search::hold_against_a_drift(const Around& baseline) {
  if (found_.added.size() != 1 || !data_.has(Chain::kTorque)) return;
  const std::vector<Trial>& trials = found_.steps.front().trials;
  const Trial& named = trials.front();
  if (!is_slip(library_.hypotheses[static_cast<std::size_t>(named.hypothesis)])) return;
  if (std::any_of(trials.begin(), trials.end(), [&](const Trial& t) {
        const Hypothesis& h = library_.hypotheses[static_cast<std::size_t>(t.hypothesis)];
        return t.in_set && h.clock == Clock::kDay && !is_slip(h);
      }))
    return;  // told by its name
  const GenericFit drift = straight_drift(baseline);
  if (drift.functions.empty()) return;
  const Comparison behind = behind_generic(data_, named.residual, ranking_.parameters_of(named), drift);
  say(fmt::format("{}: a straight drift is {:.1f} sigma {} ({:.1f} sigma of data between them)",
                  ranking_.id_of(named), std::abs(behind.t), behind.t > 0 ? "ahead" : "behind",
                  behind.separation));
  if (behind.separation >= kTwinLimit && behind.t <= kCloserThanChance - 0.5 * behind.separation) return;
  found_.doubts.push_back(
      fmt::format("It may have moved slowly: a drift that is straight over the day does as well, or nearly "
                  "({:.1f} sigma {}, where {:.1f} sigma of data lie between).",
                  std::abs(behind.t), behind.t > 0 ? "ahead" : "behind", behind.separation));
}

bool Search::are_beaten(const Comparison& behind, const std::string& rivals, const std::string& made_of,
                        const Closed& closed) {
  std::string names;
  for (std::size_t i = 0; i < found_.added.size(); ++i)
    names += (i > 0 ? " and " : "") + ranking_.id_of(found_.steps[i].trials.front());
  if (!is_beaten(behind)) {
    const bool alike = behind.separation < kTwinLimit;
    say(fmt::format("{}: {}{} {} ({:.1f} sigma of data between them)", names, rivals, made_of,
                    alike ? "leaves the same" : "is " + sigma_ahead(behind), behind.separation));
    return false;
  }
  const double share = behind.separation * behind.separation / closed.units;
  if (share < closed.hardly_any) {
    found_.doubts.push_back(fmt::format(
        "{} is {:.1f} sigma ahead, and differs from it by {:.2g} of what it closes: that may be an error of "
        "its equation, or it may be something that is nearly like it.",
        upper_first(rivals), behind.t, share));
    say(names + ": " + found_.doubts.back());
    return true;
  }
  const std::string sentence = fmt::format("ruled out: {:.1f} sigma behind {}", behind.t, rivals);
  for (std::size_t i = 0; i < found_.added.size(); ++i)
    found_.notes.push_back({ranking_.id_of(found_.steps[i].trials.front()), sentence});
  say(names + ": " + sentence + made_of);
  found_.adequate = false;
  return true;
}

void Search::hold_against_functions(const Around& baseline) {
  const GenericFit generic = rival_without_a_name(baseline, found_.steps.front().screen, options_.threads);
  if (generic.functions.empty()) return;
  int parameters = 0;
  unsigned common = kAllChains;  // readings that all of them enter: one function has only one
  for (std::size_t i = 0; i < found_.added.size(); ++i) {
    const Trial& named = found_.steps[i].trials.front();
    // Of those beyond the first, each was the best of many as well.
    parameters += ranking_.parameters_of(named) + (i > 0 ? kChoosingOne : 0);
    common &= together_with(chains_of(named));
  }
  // (A trial does not know of half a step of the encoder that was left to it later; the functions do.)
  const bool as_tried = found_.added.size() == 1 && !half_a_step_is_free();
  const Eigen::VectorXd left =
      as_tried ? found_.steps.front().trials.front().residual : baseline.project(found_.model.residual);
  const Comparison behind = behind_generic(data_, left, parameters, generic);
  const bool alike = behind.separation < kTwinLimit;
  if (alike && generic.functions.size() < found_.added.size() && common != 0)
    found_.doubts.push_back(fmt::format(
        "Together they do no more than one function without a name ({:.1f} sigma of data between them): it "
        "may be one thing, and neither of them.",
        behind.separation));
  const double closed = (baseline.residual.squaredNorm() - left.squaredNorm()) / behind.unit;
  if (are_beaten(behind, "a fit without a name", " (" + names_of(generic, data_) + ")", {closed, kHardlyAny}))
    return;
  const double between = behind.separation * behind.separation;
  if (!alike && between >= kWorthComparing * closed && behind.t > kCloserThanChance - 0.5 * behind.separation)
    found_.doubts.push_back(
        fmt::format("Functions without a name do as well, or nearly: they are {}, where {:.1f} sigma "
                    "of data lie between.",
                    sigma_ahead(behind), behind.separation));
}

void Search::hold_against_any_valve() {
  if (!touches_pressures()) return;
  struct Rival {
    AnyValve (*fit)(const Around&, int);
    const char* words;
  };
  constexpr Rival kRivals[] = {{any_lag, "a valve unit whose lag has any shape"},
                               {any_curve, "a valve unit whose rate is any function of its error"}};
  struct Asked {
    const char* rival;
    Comparison behind;
  };
  const auto ask = [&](const Around& beside) {
    std::vector<Asked> answers;
    for (const Rival& rival : kRivals)
      if (const AnyValve any = rival.fit(beside, options_.threads); any.columns > 0)
        answers.push_back({rival.words, behind_any_valve(beside, any)});
    return answers;
  };
  const auto beats = [](const Asked& asked) { return is_beaten(asked.behind); };
  const std::vector<Asked> named = ask(place_);
  const auto first = std::find_if(named.begin(), named.end(), beats);
  std::vector<Trial>& trials = found_.steps.front().trials;
  const bool alone = found_.added.size() == 1 && found_.steps.size() == 2;
  for (std::size_t i = 1; alone && first != named.end() && i < trials.size(); ++i) {
    if (!trials[i].in_set || (chains_of(trials[i]) & kPressureChains) == 0) continue;
    Fit other = with({trials[i]});
    const std::vector<Asked> others = ask(around(predictor_, other, found_.weights));
    if (std::any_of(others.begin(), others.end(), beats)) continue;
    say(fmt::format("{} is {} of {}, not of {}: that takes its place", first->rival,
                    sigma_ahead(first->behind), ranking_.id_of(trials.front()), ranking_.id_of(trials[i])));
    put_first(i);
    found_.added.front() = trials.front().hypothesis;
    move_to(other);
    found_.steps.back() = step_here();
    found_.adequate = !is_open(found_.steps.back());
    return;
  }
  const double closed = found_.baseline.residual.squaredNorm() - found_.model.residual.squaredNorm();
  for (const Asked& asked : named)
    if (are_beaten(asked.behind, asked.rival, "", {closed / asked.behind.unit, kHardlyAnyOfValve})) return;
}

void Search::hold_against_itself(const Around& baseline) {
  const double closed = baseline.project(found_.model.residual - found_.baseline.residual).norm();
  for (std::size_t i = 0; i < found_.added.size(); ++i) {
    const std::size_t effect = found_.model.tolerances + i;
    const std::string id = found_.model.model.effects[effect].hypothesis->id();
    const Constancy size = constancy_of(baseline, found_.model, effect);
    const double alone = share_of(baseline, found_.model, effect, -1).norm();
    const bool varies = size.variation > kAsMuchAsItself && size.variation > kForSure * size.error;
    std::string why;
    if (varies)
      why = fmt::format(
          "its size is not the same throughout: from one second to the next it varies by {:.0f} % of itself",
          100 * std::sqrt(size.variation));
    else if (found_.added.size() > 1 && alone > kGiant * closed)
      why = fmt::format("it is {:.0f} times what all of them close together: they cancel", alone / closed);
    if (why.empty()) continue;
    found_.notes.push_back({id, "ruled out: " + why});
    say(id + ": ruled out: " + why);
    found_.adequate = false;
    found_.comes_and_goes = found_.comes_and_goes || varies;
  }
}

void Search::look_at_remainder() {
  if (!found_.adequate || found_.added.empty() || found_.steps.size() <= found_.added.size()) return;
  const Gate& gate = found_.steps.back().gate;
  const double p = gate.p_value;
  if (left_elsewhere_) return;  // told already
  if (found_.blurred) return;   // it is what slow turns leave of a friction that is found
  const Gatekeeper::Sized left =
      gate_.most_significant(found_.steps.back().screen, found_.weights, found_.floors);
  const bool joint = data_.baseline.terms.empty(),
             much = casts_a_doubt(p, left.size, left.chain, first_size_, joint),
             much_elsewhere = joint && p <= kSeldom && gate.size >= kWorthDoubtingOfAny * first_size_;
  if (!much && !much_elsewhere) return;
  found_.doubts.push_back(
      fmt::format("What is left over beside it noise has on one day in {:.0f}: {:.2f} of the noise floor.",
                  1 / p, much ? left.size : gate.size));
  say(found_.doubts.back());
}

void Search::look_at_moments_beside() {
  if (!found_.adequate || found_.added.empty()) return;
  const Moments moments = moments_of(data_, found_.model.residual);
  if (moments.share < kInMomentsBeside) return;
  const Label label = label_of(data_, moments.chain);
  found_.doubts.push_back(
      fmt::format("In a few moments the {} is off beside it as noise is nowhere else, most of all near "
                  "{:.1f} s of {}, {:.0f} times in mean "
                  "square.",
                  in_words(label), moments.time, data_.runs[moments.run].name, moments.times_usual));
  say(found_.doubts.back());
}

void Search::doubt_at_the_end_of_a_reading() {
  const bool reads_it_so = std::any_of(found_.added.begin(), found_.added.end(), [&](int h) {
    return library_.hypotheses[static_cast<std::size_t>(h)].reads_force;
  });
  if (reads_it_so) return;
  const EndOfReading end = acts_at_the_end_of_a_reading(
      data_, found_.model.residual - found_.baseline.residual, found_.floors.all(Chain::kTorque));
  if (end.share < kAtTheEnd) return;
  found_.doubts.push_back(fmt::format(
      "{:.0f} % of what it closes lies where a force reading stands at its largest, {:.4g} N: that reading "
      "may be clipped.",
      100 * end.share, end.force));
}

void Search::look_at_limits() {
  if (!found_.adequate || found_.added.empty()) return;
  const std::size_t before = found_.doubts.size();
  doubt_at_the_end_of_a_reading();
  for (std::size_t i = 0; i < found_.added.size(); ++i) {
    const Trial& named = found_.steps[i].trials.front();
    const char* term = library_.hypotheses[static_cast<std::size_t>(named.hypothesis)].info().term;
    // As polished: a shape may have gone on to its end.
    const Values& values = found_.model.model.effects[found_.model.tolerances + i].values;
    if (ranking_.is_limit_case(named.hypothesis, values))
      found_.doubts.push_back(
          fmt::format("The shape of {} is at the end of its range, where it is hardly told from something "
                      "simpler: it may be that.",
                      term));
    else if (ranking_.err_alike(named))
      found_.doubts.push_back(
          fmt::format("By {} both sensors err by the same: one cause of both is likelier than two.", term));
  }
  for (std::size_t i = 0; i < found_.added.size(); ++i)
    for (std::size_t k = 0; k < i; ++k) {
      const auto info = [&](std::size_t at) -> const models::EffectInfo& {
        return library_.hypotheses[static_cast<std::size_t>(found_.added[at])].info();
      };
      if (is_a_loop_with_an_offset(library_.hypotheses[static_cast<std::size_t>(found_.added[i])].id(),
                                   library_.hypotheses[static_cast<std::size_t>(found_.added[k])].id()))
        found_.doubts.emplace_back(
            "A hysteresis and an offset are together what a hysteresis that differs by direction is: it may "
            "be "
            "that.");
      if (taken_for_one_another(info(i), info(k)))
        found_.doubts.push_back(
            fmt::format("{} and {} are like one another: one effect that is neither may look like both.",
                        upper_first(info(k).term), info(i).term));
    }
  if (found_.another_pair && found_.added.size() == 2)
    found_.doubts.emplace_back(
        "Together they took the place of one effect that nearly did: one that the catalogue does not have "
        "may be like both.");
  if (found_.added.size() >= kMany)
    found_.doubts.push_back(fmt::format(
        "It takes {} effects together: one that none of them is may look like that.", found_.added.size()));
  for (std::size_t i = before; i < found_.doubts.size(); ++i) say(found_.doubts[i]);
}

}  // namespace isac::explain
