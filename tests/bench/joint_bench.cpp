// What a joint fit costs per row, from 1e4 to 1e6 rows: plain regressors with a fixed Huber loss (job J1 of docs/performance.md), the
// default with errors in variables, and one pass.
#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <random>

#include "isac/estimate/joint_fit.hpp"
#include "isac/estimate/streaming_joint_fit.hpp"

namespace {

using isac::estimate::JointFitOptions;
using isac::estimate::JointRun;

JointRun make_run(std::size_t rows) {
  JointRun run;
  run.name = "sweep";
  std::mt19937_64 engine(20);
  std::normal_distribution<double> noise(0, 0.01);
  constexpr double kRadius = 0.019, kStep = 6.283185307179586 / 8000;
  for (std::size_t i = 0; i < rows; ++i) {
    const double t = 5e-4 * static_cast<double>(i), angle = 0.6 * std::sin(5.1 * t) + 0.4 * std::sin(7.3 * t);
    const double speed = 0.6 * 5.1 * std::cos(5.1 * t) + 0.4 * 7.3 * std::cos(7.3 * t);
    const double pressure = 1e5 * std::sin(0.9 * t);
    run.time.push_back(t);
    run.angle.push_back(kStep * std::floor(angle / kStep));
    run.delta_pressure.push_back(pressure);
    run.mean_pressure.push_back(3.0 * 98066.5);
    run.output.push_back(-23450.0 * kRadius * kRadius * angle + 174.2 / 98066.5 * kRadius * pressure -
                         0.0026 * speed * speed * speed - 0.14 * speed + noise(engine));
  }
  return run;
}

JointFitOptions plain() {
  JointFitOptions options;
  options.errors_in_variables = options.effective_variance = options.parallel_filter = options.keep_rows =
      false;
  options.loss.scale = 0.05;
  options.differentiator.window = 41;
  return options;
}

void fit(benchmark::State& state, const JointFitOptions& options) {
  const std::array runs{make_run(static_cast<std::size_t>(state.range(0)))};
  for (auto _ : state) benchmark::DoNotOptimize(isac::estimate::fit_joint(runs, {}, options).rmse);
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

void plain_regressors(benchmark::State& state) {
  fit(state, plain());
}
void by_default(benchmark::State& state) {
  JointFitOptions options;
  options.keep_rows = false;
  fit(state, options);
}
void in_one_pass(benchmark::State& state) {
  const JointRun run = make_run(static_cast<std::size_t>(state.range(0)));
  for (auto _ : state) {
    isac::estimate::StreamingJointFit fit(plain());
    fit.add(run);
    benchmark::DoNotOptimize(fit.finish().rmse);
  }
  state.SetItemsProcessed(state.iterations() * state.range(0));
}

BENCHMARK(plain_regressors)->RangeMultiplier(10)->Range(10000, 1000000)->Unit(benchmark::kMillisecond);
BENCHMARK(by_default)->RangeMultiplier(10)->Range(10000, 1000000)->Unit(benchmark::kMillisecond);
BENCHMARK(in_one_pass)->RangeMultiplier(10)->Range(10000, 1000000)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
