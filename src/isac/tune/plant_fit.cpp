#include "isac/tune/plant_fit.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "isac/tune/plant_problem.hpp"
#include "isac/tune/plant_spread.hpp"

namespace isac::tune {
namespace {

constexpr double kAsGood = 1.01;    // times the least sum of squares
constexpr double kDisagree = 0.04;  // in K_crit, of two plants that fit as well as each other

std::string refusal_of(const PlantFit& fit, const PlantFitOptions& options) {
  if (!fit.converged) return "the plant's fit did not come to rest; excite more, or longer";
  if (!(fit.misfit < options.worst_misfit))
    return "the joint does not move like a lag of third order with dead time: " +
           std::to_string(static_cast<int>(std::lround(100 * fit.misfit))) +
           " % of its motion is left over; friction, slack or too little amplitude may be the cause";
  for (const char* name : {"K_crit", "T_crit"}) {
    const Estimated& e = value_of(fit, name);
    if (!std::isfinite(e.value))
      return "the fitted plant can be given any gain without swinging; nothing follows for " + e.name;
    if (!(e.std_error < options.worst_error * e.value))
      return e.name + " is not known well enough from this record; excite more, or longer";
  }
  return {};
}

/// Akaike's weight of the form with one parameter more.
double weight_of_bent(const PlantProblem& problem, const PlantSolution& shifted, const PlantSolution& bent) {
  const double gained = static_cast<double>(problem.residuals()) * std::log(shifted.cost / bent.cost);
  return 1 / (1 + std::exp(0.5 * (2 - gained)));
}

/// Plants that fit as well as the best but swing at another gain: then the record does not tell.
std::string disagreement_of(const PlantProblem& problem, const PlantSolution& best,
                            const std::vector<PlantSolution>& solutions) {
  const auto critical = ultimate(plant_loop(plant_of(problem, best.x)));
  for (const PlantSolution& s : solutions) {
    if (!std::isfinite(s.cost) || s.cost > kAsGood * best.cost) continue;
    const auto other = ultimate(plant_loop(plant_of(problem, s.x)));
    if (critical && other && std::abs(other->gain / critical->gain - 1) < kDisagree) continue;
    return "two plants fit the record equally well and differ in K_crit; use the relay, or excite more";
  }
  return {};
}

}  // namespace

ExperimentRecord even_record(const ExperimentRecord& record) {
  const std::size_t n = record.time.size();
  std::vector<double> steps(n - 1);
  for (std::size_t k = 1; k < n; ++k) steps[k - 1] = record.time[k] - record.time[k - 1];
  std::nth_element(steps.begin(), steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2), steps.end());
  // The median finds the period where ticks were lost, but not to one part in their number: every step is counted in whole periods,
  // and the grid is the line through all stamps over their counts. A period that is off would let rows and commands drift apart, and a
  // grid that hangs on one trembling stamp would shift all angles against all commands, which is a dead time.
  const double median = steps[steps.size() / 2];
  std::vector<double> count(n, 0.0);
  double mean_count = 0, mean_time = 0, squares = 0, products = 0;
  for (std::size_t k = 1; k < n; ++k)
    count[k] = count[k - 1] + std::max(0.0, std::floor((record.time[k] - record.time[k - 1]) / median + 0.5));
  for (std::size_t k = 0; k < n; ++k) {
    mean_count += count[k] / static_cast<double>(n);
    mean_time += record.time[k] / static_cast<double>(n);
  }
  for (std::size_t k = 0; k < n; ++k) {
    squares += (count[k] - mean_count) * (count[k] - mean_count);
    products += (count[k] - mean_count) * (record.time[k] - mean_time);
  }
  const double interval = products / squares, start = mean_time - interval * mean_count;
  const auto rows = static_cast<std::size_t>(count.back()) + 1;
  ExperimentRecord even;
  std::size_t at = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    const double t = start + static_cast<double>(k) * interval;
    while (at + 1 < n && record.time[at + 1] <= t) ++at;
    const std::size_t next = std::min(at + 1, n - 1);
    const double gap = record.time[next] - record.time[at];
    const double share = gap > 0 ? std::clamp((t - record.time[at]) / gap, 0.0, 1.0) : 0.0;
    even.time.push_back(t);
    even.angle.push_back(record.angle[at] + share * (record.angle[next] - record.angle[at]));
    // A command that begins within half an interval of this row is this row's: stamps tremble, commands do not.
    even.command.push_back(record.command[share > 0.5 ? next : at]);
  }
  return even;
}

const Estimated& value_of(const PlantFit& fit, const std::string& name) {
  for (const auto* list : {&fit.derived, &fit.parameters})
    for (const Estimated& e : *list)
      if (e.name == name) return e;
  assert(false && "no such value");
  return fit.parameters.front();
}

PlantFit fit_plant(const ExperimentRecord& record, const PlantFitOptions& options) {
  const PlantProblem problem = plant_problem(record, options);
  PlantSolution best;
  std::vector<PlantSolution> solutions;
  for (const PlantVector& start : starts_of(problem)) {
    solutions.push_back(solve(problem, start, LagForm::kLag));
    const PlantSolution& s = solutions.back();
    if (std::isfinite(s.cost) && s.cost < best.cost) best = s;
  }
  PlantFit fit;
  fit.record = problem.record;
  fit.converged = best.converged;
  fit.solver_summary = best.summary;
  if (!std::isfinite(best.cost)) {
    fit.refusal = "no plant could be fitted to the record; did the joint move with the command?";
    return fit;
  }
  fit.plant = plant_of(problem, best.x);
  fit.predicted = motion_of(problem, best.x);
  double squares = 0;
  for (std::size_t k = 0; k < fit.predicted.size(); ++k)
    squares += std::pow(problem.record.angle[k] - fit.predicted[k], 2);
  const double mean_square = squares / static_cast<double>(fit.predicted.size());
  fit.rmse = std::sqrt(mean_square);
  fit.misfit = std::sqrt(std::max(0.0, mean_square - options.noise * options.noise)) / problem.size;
  const Spread spread = spread_of(problem, best.x, LagForm::kLag);
  for (const Fact& fact : parameter_facts())
    fit.parameters.push_back(estimated(fact, problem, best.x, spread));
  for (Estimated& e : fit.parameters) e.ci_low = e.ci_low < 0 ? 0 : e.ci_low;  // none can be negative
  // What follows from the plant is taken in orders of s: dead time of either sign first, then the bend.
  const PlantSolution shifted = solve(problem, best.x, LagForm::kShiftedLag);
  const PlantSolution bent = solve(problem, shifted.x, LagForm::kBentLag);
  const Spread first = spread_of(problem, shifted.x, LagForm::kShiftedLag);
  const Spread second = spread_of(problem, bent.x, LagForm::kBentLag);
  const double weight = weight_of_bent(problem, shifted, bent);
  for (const Fact& fact : derived_facts())
    fit.derived.push_back(
        joined(estimated(fact, problem, shifted.x, first), estimated(fact, problem, bent.x, second), weight));
  for (const Fact& fact : joint_facts()) fit.derived.push_back(estimated(fact, problem, best.x, spread));
  fit.refusal = refusal_of(fit, options);
  if (fit.refusal.empty()) fit.refusal = disagreement_of(problem, best, solutions);
  return fit;
}

}  // namespace isac::tune
