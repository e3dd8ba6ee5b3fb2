// Fit of a lag with dead time (job J2 of docs/performance.md): 20,000 rows made as the job's generator makes them.
#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <random>

#include "isac/estimate/pcu_fit.hpp"
#include "isac/estimate/step_fit.hpp"

namespace {

isac::estimate::PcuRun make_run(std::size_t rows) {
  isac::estimate::PcuRun run;
  run.name = "step";
  std::mt19937_64 engine(77);
  std::normal_distribution<double> noise(0, 0.02);
  const double interval = 10.0 / static_cast<double>(rows);
  for (std::size_t i = 0; i < rows; ++i) {
    const double t = interval * static_cast<double>(i), s = t - 1.0237;
    run.time.push_back(t);
    run.command.push_back(t >= 1 ? 1 : 0);
    run.pressure.push_back(0.2 + (s > 0 ? 3.1 * (1 - std::exp(-s / 0.12)) : 0) + noise(engine));
  }
  return run;
}

void fit_whole(benchmark::State& state) {
  const std::array runs{make_run(static_cast<std::size_t>(state.range(0)))};
  for (auto _ : state) benchmark::DoNotOptimize(isac::estimate::fit_pcu(runs).parameters.data());
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(fit_whole)->RangeMultiplier(10)->Range(2000, 200000)->Unit(benchmark::kMillisecond);

void search_only(benchmark::State& state) {
  const isac::estimate::PcuRun run = make_run(static_cast<std::size_t>(state.range(0)));
  const isac::estimate::StepData data = isac::estimate::cut_step(run, 1.0, 0.0, 10.0, true);
  for (auto _ : state) benchmark::DoNotOptimize(isac::estimate::search_step(data, -1.0).second);
  state.SetItemsProcessed(state.iterations() * state.range(0));
}
BENCHMARK(search_only)->RangeMultiplier(10)->Range(2000, 200000)->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
