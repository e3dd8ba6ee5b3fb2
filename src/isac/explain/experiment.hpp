/// @file
/// The experiment that tells apart what the recordings cannot.
///
/// a is the best model with its values, b a rival whose parameters (and the baseline's, ψ in all) are refitted to everything
/// recorded, the new run included:
///
///   separation² = min over ψ of  Σ_old ‖x_b − x_a + S ψ‖² + Σ_new ‖x_b − x_a + S ψ‖² + prior(ψ),  over the noise unit c
///
/// x are responses, S sensitivities of the baseline and of b; rows are weighted by their noise. What b can mimic is thereby
/// taken out, and information adds up run by run: each run is one Gram matrix of (S, x). Both ways round count (a true and b
/// refitted, b true and a refitted) and the smaller one is taken; of two models of which one is a special case of the other
/// the general one is taken as true, since it mimics the special one always.
/// Of about 150 possible runs (experiment_runs.hpp) the one with the largest smallest separation is taken, improved by a
/// search over its numbers, and stretched to the seconds it needs, 40 at least; a second and a third are added if one is not enough. Where no
/// run reaches `least`, the answer is what to change at the rig.
///
/// Units: sigma; plans as PlannedRun says. Threads: uses `threads`; the result does not depend on their number. Errors: none.
/// Cost: about 5 ms per run and thread. Source: Atkinson and Fedorov 1975 (T-optimality); docs/derivations/experiment.md.
/// Example: `answer.next_experiment = next_experiment(predictor, library, found, {});`
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "isac/explain/experiment_runs.hpp"
#include "isac/explain/search.hpp"

namespace isac::explain {

struct ExperimentOptions {
  series::ExcitationOptions limits = {};  ///< initial_pressure is the rig's
  int threads = 2;
  double wanted =
      7;  ///< sigma that a plan is given time for: a rival 7 sigma away is ruled out 19 times in 20
  double enough = 5;    ///< below it another run is added
  double least = 3;     ///< below it no run is worth asking for
  double longest = 60;  ///< s of one run
};

/// Models that are tied, best first, in the surroundings in which they were tried.
struct Tie {
  const Predictor* predictor = nullptr;
  Fit stem;  ///< all but the effects that are tied
  Weights weights;
  std::vector<Active> models;  ///< at least two
  double noise_unit = 1;       ///< variance of a score per unit of norm
};

class Designer {
 public:
  Designer(Tie tie, const ExperimentOptions& options);

  /// (S, x)ᵀ(S, x) over the rows of a run, which must be added to those of others; empty if the run is not possible.
  using Information = Eigen::MatrixXd;
  [[nodiscard]] std::optional<Information> information(const PlannedRun& run) const;
  [[nodiscard]] const Information& recorded() const noexcept { return recorded_; }
  /// Sigma between two of the models.
  [[nodiscard]] double separation(const Information& sum, std::size_t a, std::size_t b) const;

  [[nodiscard]] const std::vector<PlannedRun>& candidates() const noexcept { return candidates_; }
  /// What to do next.
  [[nodiscard]] NextExperiment design() const;

 private:
  struct Choice {
    PlannedRun run;
    Information gram;
    double score = 0;
  };
  void look_back();
  bool suppose_typical();
  [[nodiscard]] double one_way(const Information& sum, std::size_t truth, std::size_t refitted) const;
  [[nodiscard]] double smallest(const Information& sum, const std::vector<std::size_t>& rivals) const;
  [[nodiscard]] std::vector<std::optional<Information>> all_candidates() const;
  [[nodiscard]] Choice improve(Choice choice, const Information& before,
                               const std::vector<std::size_t>& rivals) const;
  [[nodiscard]] Choice lengthen(Choice choice, const Information& before,
                                const std::vector<std::size_t>& rivals) const;

  Tie tie_;
  ExperimentOptions options_;
  RigRange range_;
  std::vector<PlannedRun> candidates_;
  std::vector<Eigen::Index> begin_;  ///< of each model's columns, then of the responses
  Eigen::VectorXd prior_;            ///< diagonal, of the parameters' columns
  Information recorded_;
};

/// What the search left tied, if anything.
[[nodiscard]] std::optional<Tie> tie_of(const Predictor& predictor, const Library& library,
                                        const Found& found);

[[nodiscard]] std::optional<NextExperiment> next_experiment(const Predictor& predictor,
                                                            const Library& library, const Found& found,
                                                            const ExperimentOptions& options);

}  // namespace isac::explain
