#include <algorithm>
#include <cmath>

#include "isac/core/units.hpp"
#include "isac/series/sweep_check_detail.hpp"

namespace isac::series::detail {
namespace {

/// Held levels: 0.15 kg/cm² moves the testbed's torque by B r Δp = 0.5 N m.
constexpr double kHeld = 0.15 * kPascalPerKgfCm2;

void check_held(Sweep& sweep) {
  const double asked = sweep.expected.held_delta_pressure;
  if (!std::isfinite(asked) || sweep.p1.empty() || sweep.p2.empty()) return;
  std::vector<double> delta(sweep.p1.size());
  for (std::size_t i = 0; i < delta.size(); ++i) delta[i] = 0.5 * (sweep.p2[i] - sweep.p1[i]);
  const double average = mean(delta);
  double square = 0.0, count = 0.0;
  for (const double value : delta) {
    if (!std::isfinite(value)) continue;
    square += (value - average) * (value - average);
    count += 1.0;
  }
  const double spread = std::sqrt(square / std::max(count, 1.0));
  const std::span<const double> all(delta);
  const std::size_t tenth = std::max<std::size_t>(1, delta.size() / 10);
  const double drift = mean(all.last(tenth)) - mean(all.first(tenth));
  if (std::abs(average - asked) > kHeld) {
    sweep.remark("pressure_not_reached", "the pressure difference stood at " + in_kgf(average) +
                                             " instead of " + in_kgf(asked) +
                                             "; check the air supply and the valves' zero, and repeat");
  } else if (spread > kHeld || std::abs(drift) > kHeld) {
    sweep.remark("pressure_not_held", "the pressure difference wandered by " + in_kgf(spread) +
                                          " and drifted by " + in_kgf(drift) + ", more than " +
                                          in_kgf(kHeld) +
                                          "; use a wider tube or a larger air tank, and repeat");
  }
}

struct StepCount {
  int steps = 0, unsettled = 0, ignored = 0;
  double worst_move = 0.0, shortest = 0.0;
};

/// Finds holds of the command that follow a jump, and looks at the last two tenths of each.
void count_steps(std::span<const double> command, std::span<const double> pressure,
                 std::span<const double> time, StepCount& count) {
  constexpr double kJump = 0.05 * kPascalPerKgfCm2;
  const std::size_t n = command.size();
  for (std::size_t from = 1; from < n;) {
    const double jump = command[from] - command[from - 1];
    std::size_t to = from + 1;
    while (to < n && command[to] == command[from]) ++to;
    const std::size_t length = to - from;
    const bool cut_short = to == n && from == n - 1;
    if (std::abs(jump) > kJump && length >= 20 && !cut_short) {
      const std::size_t tenth = length / 10;
      const double last = mean(pressure.subspan(to - tenth, tenth));
      const double before = mean(pressure.subspan(to - 2 * tenth, tenth));
      ++count.steps;
      // Of a step through a lag T, held for h, the means of the last two tenths differ by
      // e^(-0.8 h/T) (1 - e^(-0.1 h/T))^2 T/(0.1 h) of the jump: 1 % at h = 4 T.
      const double move = std::abs(last - before) / std::abs(jump);
      const double noise_allowance = 0.02 * kPascalPerKgfCm2 / std::abs(jump);
      if (move > 0.01 + noise_allowance) {
        ++count.unsettled;
        count.worst_move = std::max(count.worst_move, move);
        count.shortest = time[to - 1] - time[from];
      }
      if (std::abs(last - command[from]) > 0.5 * std::abs(jump)) ++count.ignored;
    }
    from = to;
  }
}

void check_steps(Sweep& sweep) {
  if (!sweep.expected.stepped) return;
  StepCount count;
  const Column* command_1 = sweep.recording.find("p1_cmd");
  const Column* command_2 = sweep.recording.find("p2_cmd");
  if (command_1 && !sweep.p1.empty()) count_steps(command_1->values, sweep.p1, sweep.time, count);
  if (command_2 && !sweep.p2.empty()) count_steps(command_2->values, sweep.p2, sweep.time, count);
  if (count.steps == 0) {
    sweep.remark("no_steps",
                 "0 steps of the pressure command were held for 20 samples or more; repeat it with a longer "
                 "--duration or --hold");
    return;
  }
  const std::string of = " of " + std::to_string(count.steps) + " steps ";
  if (count.ignored > 0) {
    sweep.remark("valve_did_not_follow",
                 "in " + std::to_string(count.ignored) + of +
                     "the pressure went less than half of the way; check the air supply and the "
                     "valve's cable, and repeat");
  }
  if (count.unsettled > 0) {
    sweep.remark("not_settled",
                 "in " + std::to_string(count.unsettled) + of + "the pressure still moved by " +
                     number("%.0f", 100.0 * count.worst_move) + " % of the step at the end of the hold of " +
                     number("%.2f", count.shortest) + " s; repeat it with holds twice as long");
  }
}

}  // namespace

void check_pressure(Sweep& sweep) {
  check_held(sweep);
  check_steps(sweep);
}

}  // namespace isac::series::detail
