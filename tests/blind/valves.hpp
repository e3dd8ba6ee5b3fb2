/// @file
/// Two valve units: p_cmd to the pressure in the muscle.
#pragma once

#include <algorithm>
#include <cmath>

#include "hidden.hpp"
#include "plant_parts.hpp"
#include "rig.hpp"

namespace blind {

class Valves {
 public:
  Valves(const Rig& rig, const Hidden& h, const RunPlan& run) : rig_(rig), h_(h), run_(run) {
    direct_ = h.dead_time == 0 && h.second_lag == 0 && h.vent_ratio == 0 && h.slowness == 0 &&
              h.deadband == 0 && h.droop == 0 && h.pump == 0 && h.leak_1 == 0 && h.leak_2 == 0 &&
              h.valve_play == 0;
    for (int i = 0; i < 2; ++i) {
      unit_[i].command = command(i, 0.0, kRowTime);
      unit_[i].lagged = unit_[i].command;
      unit_[i].pressure = target(unit_[i].command);
    }
    if (!direct_)  // at rest under the first command, whatever is hidden
      for (int k = 0; k < 4000; ++k) step(0, 0.0, 1e-3, 0.0);
  }

  [[nodiscard]] bool direct() const { return direct_; }
  /// A step within one row, while that row's command holds: what step() gives when nothing but the lag is between
  /// command and pressure. Only for direct().
  void hold(std::size_t row, double h) {
    const double share = fill_.of(h, rig_.T_C);
    unit_[0].pressure += share * (target(run_.command_1[row]) - unit_[0].pressure);
    unit_[1].pressure += share * (target(run_.command_2[row]) - unit_[1].pressure);
  }

  /// From t to t + h, which lies within `row`; `turned` is how far the joint turned in it.
  void step(std::size_t row, double t, double h, double turned) {
    const double sag = h_.droop * flow_;
    double filling = 0.0;
    for (int i = 0; i < 2; ++i) {
      Unit& u = unit_[i];
      double demand = h_.dead_time != 0 ? command(i, t - h_.dead_time, h) : commands(i)[row];
      if (h_.valve_play != 0) demand = u.command = follow_play(u.command, demand, h_.valve_play);
      if (h_.second_lag != 0) demand = advance(u.lagged, second_.of(h, h_.second_lag), demand);
      const double error = target(demand) * (1.0 - sag) - u.pressure;
      double change =
          error * (error < 0.0 ? vent_.of(h, rig_.T_C * (1.0 + h_.vent_ratio)) : fill_.of(h, rig_.T_C));
      if (h_.deadband != 0 && std::abs(error) < h_.deadband) change = 0.0;
      if (h_.slowness != 0) change = std::clamp(change, -h / h_.slowness, h / h_.slowness);
      filling += above(change);
      change -= (i == 0 ? h_.leak_1 : h_.leak_2) * h * u.pressure;
      change += (i == 0 ? -h_.pump : h_.pump) * turned;
      u.pressure += change;
    }
    if (h_.droop != 0) flow_ += sag_.of(h, h_.droop_time) * (filling / h - flow_);
  }

  [[nodiscard]] double p1(double day) const {
    return unit_[0].pressure + h_.crosstalk * unit_[1].pressure + hunting(day, 0.0);
  }
  [[nodiscard]] double p2(double day) const { return unit_[1].pressure + hunting(day, 1.7); }

 private:
  struct Unit {
    double command = 0.0, lagged = 0.0, pressure = 0.0;
  };

  /// The lag moves on; what follows it sees the middle of the step.
  static double advance(double& state, double share, double input) {
    const double before = state;
    state += share * (input - state);
    return 0.5 * (before + state);
  }
  [[nodiscard]] double target(double demand) const { return rig_.K_C * demand + h_.valve_offset; }
  [[nodiscard]] double hunting(double day, double phase) const {
    if (h_.hunting == 0) return 0.0;
    return h_.hunting * std::sin(kTwoPi * h_.hunting_frequency * day + h_.hunting_phase + phase);
  }
  [[nodiscard]] const std::vector<double>& commands(int i) const {
    return i == 0 ? run_.command_1 : run_.command_2;
  }
  /// The mean command from t to t + h; it changes at rows only.
  [[nodiscard]] double command(int i, double t, double h) const {
    const std::vector<double>& u = commands(i);
    const auto held = [&](double row) {
      return u[static_cast<std::size_t>(std::clamp(row, 0.0, run_.rows() - 1.0))];
    };
    constexpr double kTiny = 1e-6;  // of a row: time is a sum of steps
    const double from = t * kRate, to = (t + h) * kRate, row = floor_of(to - kTiny);
    if (from + kTiny >= row) return held(row);
    return ((row - from) * held(floor_of(from + kTiny)) + (to - row) * held(row)) / (to - from);
  }

  const Rig& rig_;
  const Hidden& h_;
  const RunPlan& run_;
  Unit unit_[2];
  Lag fill_, vent_, second_, sag_;
  double flow_ = 0.0;
  bool direct_ = true;
};

}  // namespace blind
