#include "isac/tune/tuning.hpp"

#include "isac/tune/linear_step.hpp"
#include "isac/tune/optimise.hpp"
#include "isac/tune/procedure.hpp"
#include "isac/tune/rules.hpp"

namespace isac::tune {
namespace {

Candidate pid(std::string name, const control::PidGains<double>& k) {
  Candidate c;
  c.name = std::move(name);
  c.gains.structure = control::Structure::kPid;
  c.gains.position = k;
  return c;
}

Candidate cascade(std::string name, const Gains& gains) {
  Candidate c;
  c.name = std::move(name);
  c.gains = gains;
  c.deployable = true;
  return c;
}

const char* name_of(Rule rule) {
  switch (rule) {
    case Rule::kProcedure:
      return kProcedureName;
    case Rule::kZieglerNichols:
      return kZieglerNicholsName;
    case Rule::kOptimise:
      break;
  }
  return kOptimisedName;
}

}  // namespace

std::vector<Candidate> gains_by_rule(const JointModel& model, const ClosedLoopOptions& options) {
  std::vector<Candidate> found;
  if (const auto gains = tune_by_procedure(model, options)) found.push_back(cascade(kProcedureName, *gains));
  if (const auto gains =
          tune_outer_by_ziegler_nichols(model, inner_gains(model, options.sampling), options.sampling))
    found.push_back(cascade(kZieglerNicholsName, *gains));
  LagPlant plant;
  if (!ok(lag_plant(model, plant))) return found;
  if (const auto critical = ultimate(plant_loop(plant)))
    found.push_back(pid("Ziegler-Nichols, PID", ziegler_nichols(*critical, Form::kPid)));
  const models::StepShape<double> shape = step_shape(plant);
  struct {
    const char* name;
    Aim aim;
    Overshoot overshoot;
  } constexpr kVariants[] = {{"CHR, reference, 0 %", Aim::kReference, Overshoot::kNone},
                             {"CHR, reference, 20 %", Aim::kReference, Overshoot::kTwentyPercent},
                             {"CHR, disturbance, 0 %", Aim::kDisturbance, Overshoot::kNone},
                             {"CHR, disturbance, 20 %", Aim::kDisturbance, Overshoot::kTwentyPercent}};
  for (const auto& v : kVariants)
    found.push_back(pid(v.name, chien_hrones_reswick(shape, plant.gain, Form::kPid, v.aim, v.overshoot)));
  return found;
}

Tuning tune_joint(const JointModel& model, const RelativeCovariance& spread,
                  const std::optional<Gains>& before, const TuningOptions& options) {
  Tuning tuning;
  const JointModel& moving = options.measured ? *options.measured : model;
  const std::vector<JointModel> judged = draw_joints(moving, spread, options.draws, options.seed);
  const auto judge = [&](Candidate& c) {
    c.figures = assess(model, judged, c.gains, options.limits, options.loop);
  };
  if (before) {
    tuning.before = cascade("before", *before);
    judge(*tuning.before);
  }
  tuning.candidates = gains_by_rule(moving, options.loop);
  if (options.rule == Rule::kOptimise) {
    std::vector<Gains> starts;
    for (const Candidate& c : tuning.candidates)
      if (c.name == kProcedureName) starts.push_back(c.gains);
    Gains seeds;  // 5.3, scaled from the testbed's torque per pressure to this joint's
    const double scale = models::testbed_parameters<double>().B * models::kTestbedWheelRadius /
                         (model.muscle.B * model.wheel_radius);
    seeds.position = {.proportional = 4.0, .integral = 8.0};
    seeds.torque = {.proportional = 0.1 * kPascalPerKgfCm2 * scale,
                    .integral = 10 * kPascalPerKgfCm2 * scale};
    starts.push_back(before.value_or(seeds));
    OptimiseOptions search{.limits = options.limits, .loop = options.loop};
    search.stop = options.stop;
    search.least_integral = options.least_integral;
    const auto design = draw_joints(moving, spread, options.draws, options.seed + 1);
    const Optimised best = optimise(model, design, starts, search);
    tuning.evaluations = best.evaluations;
    tuning.candidates.insert(tuning.candidates.begin(), cascade(kOptimisedName, best.gains));
  }
  for (std::size_t i = 0; i < tuning.candidates.size(); ++i) {
    Candidate& c = tuning.candidates[i];
    const bool asked = c.name == name_of(options.rule);
    if (asked || options.all_rules) judge(c);
    if (asked) tuning.chosen = i;
  }
  if (options.stop && options.stop())
    tuning.refusal = "the search was stopped by hand";
  else if (!tuning.chosen)
    tuning.refusal = "the rule has no gains for this joint";
  else
    tuning.refusal = refusal(tuning.candidates[*tuning.chosen].figures, options.limits);
  return tuning;
}

}  // namespace isac::tune
