#include <gtest/gtest.h>

#include <array>

#include "isac/core/error.hpp"
#include "isac/estimate/muscle_solve.hpp"
#include "muscle_scenes.hpp"

namespace isac::estimate {
namespace {

using test::make_muscle_runs;
using test::MuscleScene;
using test::one_model;

const Estimated& get(const MuscleModelResult& m, const std::string& name) {
  for (const Estimated& e : m.parameters)
    if (e.name == name) return e;
  throw std::logic_error("no parameter " + name);
}

TEST(MuscleFit, jacobian_of_every_model_equals_finite_differences) {
  std::vector<MuscleRun> runs = make_muscle_runs({.rows = 60});
  for (MuscleRun& run : runs)
    for (std::size_t i = 0; i < run.contraction.size(); ++i)
      run.contraction_rate.push_back(0.02 * std::sin(0.3 * static_cast<double>(i)));
  std::vector<PreparedRun> prepared;
  for (const MuscleRun& r : runs)
    prepared.push_back(prepare_run(r, 0.001, -1e9, {}, 2 * static_cast<int>(prepared.size())));
  for (const MuscleModelEntry& model : muscle_catalogue()) {
    std::vector<double> x, zeros(prepared.size(), 0.3), r, j, up, down;
    for (const MuscleParameter& p : model.parameters) x.push_back(p.start + 0.01);
    muscle_residuals(model, prepared, 0.01, x, zeros, r, &j);
    const std::size_t columns = x.size() + zeros.size();
    int tested = 0;
    for (std::size_t k = 0; k < columns; ++k) {
      std::vector<double> xa = x, xb = x, za = zeros, zb = zeros;
      const double h = 1e-6;
      (k < x.size() ? xa[k] : za[k - x.size()]) += h;
      (k < x.size() ? xb[k] : zb[k - x.size()]) -= h;
      muscle_residuals(model, prepared, 0.01, xa, za, up, nullptr);
      muscle_residuals(model, prepared, 0.01, xb, zb, down, nullptr);
      for (std::size_t i = 0; i < r.size(); ++i) {
        const double difference = (up[i] - down[i]) / (2 * h);
        if (std::abs(difference - j[i * columns + k]) > 0.4 && r[i] == up[i])
          continue;  // the kink of the slack muscle
        // Forces of 1e3 N: rounding 1e-13·1e3/1e-6 = 1e-4 in the difference, curvature below it.
        EXPECT_NEAR(j[i * columns + k], difference, 2e-3 + 1e-6 * std::abs(difference))
            << model.id << " column " << k << " row " << i;
        tested += difference != 0;
      }
    }
    EXPECT_GT(tested, 100) << model.id;
  }
}

TEST(MuscleFit, recovers_the_constants_of_an_exact_muscle) {
  const MuscleFit fit = fit_muscle(make_muscle_runs({.noise = 0}), {}, one_model("bridgestone"));
  const MuscleModelResult& m = fit.ranking.front();
  EXPECT_TRUE(m.converged);
  // Bins average a force that is linear in pressure, save the one in which the muscle leaves slack.
  EXPECT_NEAR(get(m, "a").value, 30, 1e-3);
  EXPECT_NEAR(get(m, "b").value, 18, 1e-3);
}

TEST(MuscleFit, models_that_are_the_same_equation_fit_alike) {
  MuscleFitOptions options;
  options.models = {"schulte", "bridgestone", "chou_hannaford_thin"};
  const MuscleFit fit = fit_muscle(make_muscle_runs({}), {}, options);
  const double one = fit.find("bridgestone")->train_rmse;
  EXPECT_NEAR(fit.find("schulte")->train_rmse, one, 1e-4);  // the solver's tolerance on a flat minimum
  EXPECT_NEAR(fit.find("chou_hannaford_thin")->train_rmse, one, 1e-4);
}

TEST(MuscleFit, follows_the_mean_path_and_says_the_width_of_the_hysteresis) {
  const MuscleFit fit =
      fit_muscle(make_muscle_runs({.noise = 0.2, .hysteresis = 8}), {}, one_model("bridgestone"));
  // Half a width of 4 N up and down: the mean path is the truth; near slack the cut at 0 pulls a little.
  EXPECT_NEAR(get(fit.ranking.front(), "a").value, 30, 0.3);
  for (const HysteresisWidth& h : fit.hysteresis)
    EXPECT_NEAR(h.mean, 8, 0.2) << h.run;  // noise 0.2 N over hundreds of rows
}

TEST(MuscleFit, a_zero_that_differs_by_run_is_taken_off_or_fitted) {
  std::vector<MuscleRun> runs = make_muscle_runs({.noise = 0.2});
  const double zeros[] = {5, -7, 12, 0};
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (double& f : runs[r].force) f += zeros[r];
    runs[r].force_zero = zeros[r];
  }
  EXPECT_NEAR(get(fit_muscle(runs, {}, one_model("bridgestone")).ranking.front(), "a").value, 30, 0.1);
  for (MuscleRun& run : runs) run.force_zero = std::numeric_limits<double>::quiet_NaN();
  // Unknown: the reading at the lowest pressures (there the muscle pulls a newton or two), or fitted along.
  EXPECT_NEAR(get(fit_muscle(runs, {}, one_model("bridgestone")).ranking.front(), "a").value, 30, 0.5);
  MuscleFitOptions fitted = one_model("bridgestone");
  fitted.zero = ZeroHandling::kFitted;
  const MuscleFit fit = fit_muscle(runs, {}, fitted);
  EXPECT_NEAR(get(fit.ranking.front(), "a").value, 30, 0.1);
  for (std::size_t r = 0; r < runs.size(); ++r) EXPECT_NEAR(fit.ranking.front().runs[r].zero, zeros[r], 0.2);
}

TEST(MuscleFit, readings_at_the_stop_are_censored) {
  // Zero at −8 N and a stop at −8.7 N: noise of 1 N is cut off below, and a plain mean would lie too high.
  const std::vector<MuscleRun> runs =
      make_muscle_runs({.contractions = {0.0, 0.1, 0.2, 0.23}, .zero = -8, .floor = -8.7});
  const MuscleFit fit = fit_muscle(runs, {}, one_model("bridgestone"));
  EXPECT_NEAR(get(fit.ranking.front(), "a").value, 30, 0.3);  // noise 1 N over 3200 rows, forces to 700 N
  EXPECT_GT(fit.ranking.front().runs.back().censored, 20u);
  bool said = false;
  for (const Warning& w : fit.warnings) said = said || w.code == "force_stop";
  EXPECT_TRUE(said);
}

TEST(MuscleFit, end_correction_follows_from_lengths_alone) {
  MuscleFitOptions options;
  for (const double l0 : {0.1, 0.2, 0.3, 0.4}) options.known_muscles.push_back({l0, 0.18 - 0.002 / l0});
  EXPECT_NEAR(find_end_length({}, {}, options), 0.002, 1e-12);  // an exact line
  options.known_muscles.resize(1);
  EXPECT_EQ(find_end_length({}, {}, options), 0.0);
  options.end_length = 0.003;
  EXPECT_EQ(find_end_length({}, {}, options), 0.003);
}

TEST(MuscleFit, ranks_by_held_out_records) {
  const std::vector<MuscleRun> train = make_muscle_runs({.seed = 1});
  const std::vector<MuscleRun> heldout = make_muscle_runs({.contractions = {0.03, 0.12, 0.18}, .seed = 2});
  const MuscleFit fit = fit_muscle(train, heldout);
  ASSERT_EQ(fit.ranking.size(), muscle_model_ids().size());
  for (std::size_t k = 1; k < fit.ranking.size(); ++k)
    EXPECT_LE(fit.ranking[k - 1].heldout_rmse, fit.ranking[k].heldout_rmse);
  EXPECT_NEAR(fit.ranking.front().heldout_rmse, 1.0, 0.1);  // the noise of 1 N
  EXPECT_NEAR(fit.find("bridgestone")->heldout_rmse, 1.0, 0.1);
}

TEST(MuscleFit, scores_a_foreign_law_as_it_scores_its_own) {
  const std::vector<MuscleRun> runs = make_muscle_runs({});
  const models::BridgestoneMuscle<double> truth{.diameter = 0.01, .a = 30, .b = 18};
  for (const MuscleRunResult& r : score_muscle_law(
           runs, [&](double p, double e, const MuscleRun&) { return models::force(truth, p, e); }))
    EXPECT_NEAR(r.rmse, 1.0, 0.1) << r.name;
}

TEST(MuscleFit, refuses_by_name_what_the_runs_cannot_tell) {
  const MuscleFit fit = fit_muscle(make_muscle_runs({}), {});
  EXPECT_FALSE(get(*fit.find("cai_yamaura"), "omega").identifiable);
  EXPECT_NE(get(*fit.find("cai_yamaura"), "omega").reason.find("does not move"), std::string::npos);
  EXPECT_FALSE(get(*fit.find("kerscher"), "f0").identifiable);

  const MuscleFit flat = fit_muscle(make_muscle_runs({.contractions = {0.05}}), {}, one_model("bridgestone"));
  EXPECT_FALSE(get(flat.ranking.front(), "a").identifiable);  // a and b enter by one number only
  EXPECT_EQ(flat.warnings.front().code, "one_contraction");
}

TEST(MuscleFit, refuses_unknown_models_and_empty_data) {
  EXPECT_THROW((void)fit_muscle(make_muscle_runs({}), {}, one_model("hill")), Error);
  EXPECT_THROW((void)fit_muscle({}, {}), Error);
  std::vector<MuscleRun> runs = make_muscle_runs({});
  runs[0].force.pop_back();
  EXPECT_THROW((void)fit_muscle(runs, {}), Error);
}

}  // namespace
}  // namespace isac::estimate
