#include "explain/plan.hpp"

#include "isac/explain/experiment_runs.hpp"

namespace isac::apps {

series::Plan plan_of(const explain::Explanation& answer) {
  series::Plan plan;
  if (!answer.next_experiment) return plan;
  const explain::NextExperiment& next = *answer.next_experiment;
  plan.reason = next.sentence;
  for (const std::string& id : {next.separates_a, next.separates_b})
    if (!id.empty()) plan.separates.push_back(id);
  for (const explain::PlannedRun& run : next.runs) plan.runs.push_back(explain::plan_run(run));
  return plan;
}

}  // namespace isac::apps
