// The controllers in single precision, as a firmware would run them: six joints, their faults, their start-up.
#include <array>
#include <cstddef>
#include <cstdint>

#include "isac/control/arm_controller.hpp"
#include "isac/control/deployed.hpp"
#include "isac/control/fault_machine.hpp"
#include "isac/control/joint_controller.hpp"
#include "isac/control/stability.hpp"
#include "isac/control/velocity_estimate.hpp"
#include "isac/control/watches.hpp"

namespace isac::control {

template class Pid<float>;
template class VelocityEstimate<float>;
template class JointPredictor<float>;
template class JointController<float>;
template class FeedForward<float>;
template class ArmController<float, 6>;
template class JointWatch<float>;
template class EncoderWatch<float>;
template Status settings_of<float>(const models::ParameterTable&, int, JointSettings<float>&) noexcept;
template Status feed_forward_of<float>(const models::ParameterTable&, int, FeedForward<float>&,
                                       int&) noexcept;
template bool is_hurwitz<float, 6>(const std::array<float, 6>&) noexcept;

}  // namespace isac::control

namespace {
isac::control::ArmController<float, 6> arm;
isac::control::FaultMachine machine;
isac::control::InputWatch input;
}  // namespace

/// One tick for a firmware: angles in, pressures of twelve valves out; 0 when the valves may have them, else vented.
extern "C" int isac_control_tick(const float* angle, const float* velocity, const float* wanted, float dt,
                                 long long now_ns, unsigned code, int armed, float* pressure) {
  using namespace isac::control;
  std::array<JointMeasurement<float>, 6> now{};
  std::array<ArmReference<float>, 6> reference{};
  std::array<JointCommand<float>, 6> command{};
  for (std::size_t i = 0; i < 6; ++i) {
    now[i] = {.angle = angle[i], .velocity = velocity[i]};
    reference[i].angle = wanted[i];
  }
  machine.begin({.now = now_ns, .sampled = now_ns, .arm = armed != 0, .finding = input.check(code, true, 0)});
  int failed = -1;
  if (!isac::ok(arm.step(now, reference, dt, command, failed)))
    machine.report({.code = FaultCode::kCommandNotFinite, .joint = static_cast<std::int8_t>(failed)});
  const bool vents = machine.vents();
  for (std::size_t i = 0; i < 6; ++i) {
    pressure[2 * i] = vents ? 0.0f : command[i].pressure.muscle_1;
    pressure[2 * i + 1] = vents ? 0.0f : command[i].pressure.muscle_2;
  }
  return vents ? 1 : 0;
}
