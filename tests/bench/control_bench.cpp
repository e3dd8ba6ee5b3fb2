// What one control tick costs on this machine: the six-joint step in double and in float, its parts, and the firmware's tick.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <type_traits>
#include <vector>

#include "../../apps/embedded/simulated_arm.hpp"
#include "isac/control/deployed.hpp"
#include "isac/models/arm/soft_arm.hpp"
#include "isac/record/params.hpp"
#include "isac/record/tables.hpp"

namespace {

using namespace isac::control;
using isac::embedded::ArmLoop;
using isac::embedded::kJoints;

/// What stops a benchmark before it measures something else than it says.
void need(isac::Status status) {
  if (!isac::ok(status)) std::abort();
}

std::vector<std::byte> packed() {
  const std::filesystem::path params =
      std::filesystem::path(ISAC_SOURCE_DIR) / "tests/embedded/soft_arm.params.toml";
  return isac::record::make_tables(isac::record::read_params(params)).binary;
}

std::unique_ptr<ArmLoop> started_loop() {
  auto loop = std::make_unique<ArmLoop>();
  need(loop->start(packed()));
  return loop;
}

/// The arm of the table in the scalar S, in position mode.
template <class S>
std::unique_ptr<ArmController<S, 6>> arm_of_table(bool predict = false) {
  auto arm = std::make_unique<ArmController<S, 6>>();
  isac::models::ParameterTable table;
  need(isac::models::load_parameter_table(packed(), table));
  for (std::size_t i = 0; i < kJoints; ++i) {
    JointSettings<S> settings;
    int left_out = 0;
    need(settings_of(table, static_cast<int>(i), settings));
    need(feed_forward_of(table, static_cast<int>(i), arm->feed_forward[i], left_out));
    settings.predict_dead_time = predict;
    need(arm->joints[i].configure(settings));
    need(arm->joints[i].set_mode(Mode::kPosition));
  }
  if constexpr (std::is_same_v<S, double>) {
    arm->chain = isac::models::soft_arm_chain(isac::models::SoftArmGeometry<double>{});
  } else {
    arm->chain = started_loop()->arm().chain;
  }
  arm->coupling = isac::models::soft_arm_coupling<S>();
  return arm;
}

template <class S>
struct Tick {
  std::array<JointMeasurement<S>, kJoints> now{};
  std::array<ArmReference<S>, kJoints> wanted{};
};

/// A second of sines on six joints, followed with a small error.
template <class S>
std::vector<Tick<S>> motion() {
  std::vector<Tick<S>> ticks(2000);
  for (std::size_t k = 0; k < ticks.size(); ++k) {
    for (std::size_t i = 0; i < kJoints; ++i) {
      const double rate = 6.283185307179586 * static_cast<double>(i + 1),
                   phase = rate * 5e-4 * static_cast<double>(k);
      ticks[k].now[i] = {.angle = S(0.15 * std::sin(phase - 0.02)),
                         .velocity = S(0.15 * rate * std::cos(phase - 0.02))};
      ticks[k].wanted[i] = {.angle = S(0.15 * std::sin(phase)),
                            .velocity = S(0.15 * rate * std::cos(phase)),
                            .acceleration = S(-0.15 * rate * rate * std::sin(phase))};
    }
  }
  return ticks;
}

template <class S>
void run(benchmark::State& state, ArmController<S, 6>& arm) {
  const auto ticks = motion<S>();
  std::array<JointCommand<S>, kJoints> command{};
  int failed = -1;
  std::size_t k = 0;
  for (auto _ : state) {
    need(arm.step(ticks[k].now, ticks[k].wanted, S(5e-4), command, failed));
    benchmark::DoNotOptimize(command);
    k = k + 1 == ticks.size() ? 0 : k + 1;
  }
}

template <class S>
void six_joints(benchmark::State& state) {
  run(state, *arm_of_table<S>());
}
template <class S>
void six_joints_without_compensation(benchmark::State& state) {
  const auto arm = arm_of_table<S>();
  arm->compensate = false;
  run(state, *arm);
}
template <class S>
void six_joints_with_dead_time_predictor(benchmark::State& state) {
  run(state, *arm_of_table<S>(true));
}
template <class S>
void one_joint(benchmark::State& state) {
  const auto arm = arm_of_table<S>();
  const auto ticks = motion<S>();
  JointCommand<S> command;
  std::size_t k = 0;
  for (auto _ : state) {
    need(arm->joints[0].step(ticks[k].now[0], {.angle = ticks[k].wanted[0].angle}, S(5e-4), command));
    benchmark::DoNotOptimize(command);
    k = k + 1 == ticks.size() ? 0 : k + 1;
  }
}

/// What gravity asks of the six joints, through the coupling.
template <class S>
void gravity_of_six_joints(benchmark::State& state) {
  const auto arm = arm_of_table<S>();
  const auto ticks = motion<S>();
  LinkTwists<S, 6> twists;
  std::size_t k = 0;
  for (auto _ : state) {
    isac::models::JointVector<S, 6> angle;
    for (std::size_t i = 0; i < kJoints; ++i) angle[i] = ticks[k].now[i].angle;
    benchmark::DoNotOptimize(
        compensation_torque<S, 6>(arm->chain, arm->coupling, angle, {}, InertiaShare::kNone, twists));
    k = k + 1 == ticks.size() ? 0 : k + 1;
  }
}

/// Every step by itself on the clock: how far the slow ones lie from the median. The clock's own reading is measured the same way.
template <class S>
void spread_of_six_joints(benchmark::State& state) {
  using Clock = std::chrono::steady_clock;
  const auto arm = arm_of_table<S>();
  const auto ticks = motion<S>();
  std::array<JointCommand<S>, kJoints> command{};
  int failed = -1;
  std::vector<double> took, clock;
  took.reserve(200'000);
  clock.reserve(200'000);
  for (auto _ : state) {
    took.clear();
    clock.clear();
    for (std::size_t n = 0; n < 200'000; ++n) {
      const auto& tick = ticks[n % ticks.size()];
      const auto begin = Clock::now();
      need(arm->step(tick.now, tick.wanted, S(5e-4), command, failed));
      benchmark::DoNotOptimize(command);
      const auto end = Clock::now();
      const auto again = Clock::now();
      took.push_back(static_cast<double>((end - begin).count()));
      clock.push_back(static_cast<double>((again - end).count()));
    }
  }
  const auto share = [](std::vector<double>& values, double part) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(values.size()));
    std::nth_element(values.begin(), at, values.end());
    return *at;
  };
  state.counters["p50_ns"] = share(took, 0.5);
  state.counters["p99_ns"] = share(took, 0.99);
  state.counters["p99.9_ns"] = share(took, 0.999);
  state.counters["clock_ns"] = share(clock, 0.5);
}

/// With encoders, watches and fault machine, in float, as on the microcontroller but with this machine's libm.
void whole_tick_of_the_firmware(benchmark::State& state) {
  using namespace isac::embedded;
  const auto loop = started_loop();
  SimulatedArm arm;
  arm.start(*loop);
  Story story;
  std::vector<Sample> samples(1200);  // up to the first blow of the story
  std::vector<Wanted> wanted(samples.size());
  for (std::size_t k = 0; k < samples.size(); ++k) story.at(static_cast<int>(k), arm, samples[k], wanted[k]);
  std::int64_t now = 0;
  std::size_t k = 0;
  bool armed = false;
  for (auto _ : state) {
    samples[k].now = samples[k].sampled = now += kPeriodNs;
    const Valves valves = loop->tick(samples[k], wanted[k]);
    armed = armed || valves.state == RunState::kArmed;
    benchmark::DoNotOptimize(valves);
    k = k + 1 == samples.size() ? kFirstArm : k + 1;
  }
  if (!armed && state.iterations() > 1000) std::abort();
}

BENCHMARK(six_joints<double>);
BENCHMARK(six_joints<float>);
BENCHMARK(six_joints_without_compensation<double>);
BENCHMARK(six_joints_without_compensation<float>);
BENCHMARK(six_joints_with_dead_time_predictor<double>);
BENCHMARK(six_joints_with_dead_time_predictor<float>);
BENCHMARK(gravity_of_six_joints<double>);
BENCHMARK(gravity_of_six_joints<float>);
BENCHMARK(spread_of_six_joints<double>)->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK(spread_of_six_joints<float>)->Iterations(1)->Unit(benchmark::kMillisecond);
BENCHMARK(one_joint<double>);
BENCHMARK(one_joint<float>);
BENCHMARK(whole_tick_of_the_firmware);

}  // namespace

BENCHMARK_MAIN();
