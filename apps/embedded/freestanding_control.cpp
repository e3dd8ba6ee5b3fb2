// The controllers in single precision; the loop of a firmware around them is arm_loop.cpp.
#include <array>

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
