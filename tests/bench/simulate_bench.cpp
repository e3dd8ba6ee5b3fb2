// How fast the simulated rig runs: samples a second of a 500 Hz recording, and simulated seconds a second of real time.
#include <benchmark/benchmark.h>

#include <string>

#include "isac/card/card.hpp"

namespace {

using isac::card::Command;
using isac::card::open;
using isac::card::Sample;
using isac::card::Task;

constexpr std::int64_t kPeriod = 2'000'000;  // 500 Hz

/// One second of the rig per iteration; `write` gives it a new command at every sample.
void run(benchmark::State& state, const std::string& name, const Task& task, bool write) {
  const auto rig = open(name);
  Command command;
  command.output[0] = command.output[1] = 2457;
  bool good = ok(rig.card->write(command)) && ok(rig.card->wait_until(2'000'000'000));
  rig.person->ask(task);
  Sample sample;
  std::int64_t k = 1000;
  for (auto _ : state) {
    for (int n = 0; n < 500; ++n, ++k) {
      good = good && ok(rig.card->wait_until(k * kPeriod)) && ok(rig.card->read(sample));
      if (!write) continue;
      command.output[0] = static_cast<std::uint32_t>(2400 + k % 100);
      good = good && ok(rig.card->write(command));
    }
  }
  if (!good) state.SkipWithError("the card failed");
  benchmark::DoNotOptimize(sample);
  state.SetItemsProcessed(state.iterations() * 500);
  state.counters["simulated_s_per_s"] =
      benchmark::Counter(static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}

const Task kFree{};
const Task kSweep{
    .kind = Task::Kind::kSweepByHand, .amplitude_rad = 0.4, .speed_rad_s = 6, .vary_speed = true};

void swept_by_hand(benchmark::State& state) {
  run(state, "sim:", kSweep, false);
}
void free_joint_under_control(benchmark::State& state) {
  run(state, "sim:", kFree, true);
}
void free_joint_with_dry_friction(benchmark::State& state) {
  run(state, "sim:effect=stribeck_friction,effect=hysteresis", kFree, true);
}
void swept_with_valve_and_sensor_effects(benchmark::State& state) {
  run(state, "sim:effect=second_order_lag,effect=volume_coupling,effect=sensor_lag,effect=time_skew", kSweep,
      false);
}

BENCHMARK(swept_by_hand);
BENCHMARK(free_joint_under_control);
BENCHMARK(free_joint_with_dry_friction);
BENCHMARK(swept_with_valve_and_sensor_effects);

}  // namespace

BENCHMARK_MAIN();
