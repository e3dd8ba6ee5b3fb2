#include "isac/tune/rules.hpp"

namespace isac::tune {
namespace {

struct Row {
  double gain, integral, derivative;  ///< c, c_I, c_D; an integral or derivative of 0: none
};

control::PidGains<double> from_times(double gain, double integral_time, double derivative_time) noexcept {
  return {.proportional = gain,
          .integral = integral_time > 0 ? gain / integral_time : 0.0,
          .derivative = gain * derivative_time};
}

// [aim][overshoot][form], as published; the seed uses reference, none, PID: 0.6, 1.0, 0.5.
constexpr Row kChienHronesReswick[2][2][3] = {
    {{{0.3, 0, 0}, {0.35, 1.2, 0}, {0.6, 1.0, 0.5}}, {{0.7, 0, 0}, {0.6, 1.0, 0}, {0.95, 1.35, 0.47}}},
    {{{0.3, 0, 0}, {0.6, 4.0, 0}, {0.95, 2.4, 0.42}}, {{0.7, 0, 0}, {0.7, 2.3, 0}, {1.2, 2.0, 0.42}}}};
constexpr Row kZieglerNichols[3] = {{0.5, 0, 0}, {0.45, 0.85, 0}, {0.6, 0.5, 0.12}};

}  // namespace

control::PidGains<double> ziegler_nichols(const Ultimate& critical, Form form) noexcept {
  const Row& row = kZieglerNichols[static_cast<int>(form)];
  return from_times(row.gain * critical.gain, row.integral * critical.period,
                    row.derivative * critical.period);
}

control::PidGains<double> chien_hrones_reswick(const models::StepShape<double>& step, double plant_gain,
                                               Form form, Aim aim, Overshoot overshoot) noexcept {
  const Row& row =
      kChienHronesReswick[static_cast<int>(aim)][static_cast<int>(overshoot)][static_cast<int>(form)];
  const double base = aim == Aim::kReference ? step.adjustment : step.latency;
  return from_times(row.gain * step.adjustment / (plant_gain * step.latency), row.integral * base,
                    row.derivative * step.latency);
}

Controllability controllability(const models::StepShape<double>& step) noexcept {
  const double ratio = step.latency / step.adjustment;
  return ratio < 0.1 ? Controllability::kEasy : ratio > 0.8 ? Controllability::kHard : Controllability::kFair;
}

const char* describe(Controllability verdict) noexcept {
  switch (verdict) {
    case Controllability::kEasy:
      return "easy to control (T_L/T_A below 0.1)";
    case Controllability::kHard:
      return "hard to control (T_L/T_A above 0.8)";
    case Controllability::kFair:
      break;
  }
  return "neither easy nor hard to control (T_L/T_A between 0.1 and 0.8)";
}

}  // namespace isac::tune
