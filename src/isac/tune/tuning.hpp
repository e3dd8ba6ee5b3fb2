/// @file
/// The whole of a tuning on a known joint: every rule's gains, the search, the verdict, beside the gains that were there before.
///
/// `chosen` is the index of the candidate that the rule asked for; `refusal` says why its gains may not be deployed (then the old
/// ones stay). Every candidate is judged on the same draws; those of the search on others than it was made with.
/// Units: SI. Threads: pure. Errors: none; a rule without an answer is left out. Source: docs/tuning.md.
/// Example: `tune_joint(model, errors, old, {.rule = Rule::kOptimise})`.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "isac/tune/assess.hpp"

namespace isac::tune {

enum class Rule { kOptimise, kProcedure, kZieglerNichols };

struct Candidate {
  std::string name;  ///< "seed's procedure", "Ziegler-Nichols, PID"
  Gains gains;
  Assessment figures;
  bool deployable = false;  ///< of the structure that `[gains]` holds
};

struct TuningOptions {
  Rule rule = Rule::kOptimise;
  Limits limits{};
  int draws = 200;
  std::uint64_t seed = 1;
  std::optional<JointModel> measured =
      {};                       ///< the joint that moves, where it is not the one the controller believes in
  double least_integral = 0.1;  ///< 1/s, see optimise.hpp
  bool all_rules = true;        ///< judge every rule, not only the one asked for
  ClosedLoopOptions loop{};
  std::function<bool()> stop = {};
};

struct Tuning {
  std::vector<Candidate> candidates;
  std::optional<Candidate> before;  ///< the gains that were there
  std::optional<std::size_t> chosen;
  std::string refusal;
  int evaluations = 0;  ///< of the search
};

[[nodiscard]] Tuning tune_joint(const JointModel& model, const RelativeCovariance& spread,
                                const std::optional<Gains>& before, const TuningOptions& options = {});

/// Every rule's gains on this joint: Ziegler-Nichols and the four of Chien-Hrones-Reswick for a PID, both ways for the cascade.
[[nodiscard]] std::vector<Candidate> gains_by_rule(const JointModel& model,
                                                   const ClosedLoopOptions& options = {});

/// Names of candidates that rules look for.
inline constexpr const char* kProcedureName = "seed's procedure";
inline constexpr const char* kZieglerNicholsName = "Ziegler-Nichols, position loop";
inline constexpr const char* kOptimisedName = "optimised";

}  // namespace isac::tune
