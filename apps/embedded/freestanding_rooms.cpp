// Every freestanding equation in single precision: what does not build here, or asks for a heap, is not freestanding.
#include "isac/core/angles.hpp"
#include "isac/core/crc32.hpp"
#include "isac/core/status.hpp"
#include "isac/core/units.hpp"
#include "isac/models/arm/coupling.hpp"
#include "isac/models/arm/soft_arm.hpp"
#include "isac/models/effect_hooks.hpp"
#include "isac/models/joint_motion.hpp"
#include "isac/models/joint_torque.hpp"
#include "isac/models/muscle_pair.hpp"
#include "isac/models/parameter_table.hpp"
#include "isac/models/valve_unit.hpp"

namespace isac {

template float wrap_to_2pi<float>(const float&) noexcept;
template float wrap_to_pi<float>(const float&) noexcept;

namespace models {

template float force<float>(const SchulteMuscle<float>&, const float&, const float&, const float&) noexcept;
template float force<float>(const ThinWallMuscle<float>&, const float&, const float&, const float&) noexcept;
template float force<float>(const ThickWallMuscle<float>&, const float&, const float&, const float&) noexcept;
template float force<float>(const BridgestoneMuscle<float>&, const float&, const float&,
                            const float&) noexcept;
template float force<float>(const CaiYamauraMuscle<float>&, const float&, const float&,
                            const float&) noexcept;
template float force<float>(const KerscherMuscle<float>&, const float&, const float&, const float&) noexcept;
template float force<float>(const PolynomialMuscle<float>&, const float&, const float&,
                            const float&) noexcept;
template float force<float>(const SecondOrderMuscle<float>&, const float&, const float&,
                            const float&) noexcept;
template float pair_torque<BridgestoneMuscle, float>(const MusclePair<BridgestoneMuscle, float>&,
                                                     const float&, const float&, const float&,
                                                     const float&) noexcept;

template float joint_torque<float>(const JointCoefficients<float>&, const float&, const float&, const float&,
                                   const float&) noexcept;
template Status delta_pressure_for_torque<float>(const JointCoefficients<float>&, const float&, const float&,
                                                 const float&, const float&, float&) noexcept;
template std::uint8_t outside_validity<float>(const ValidityRange<float>&, const float&, const float&,
                                              const float&) noexcept;
template Status second_order<float>(const JointCoefficients<float>&, const float&, const float&,
                                    SecondOrder<float>&) noexcept;
template Status step_shape<float>(const SecondOrder<float>&, StepShape<float>&) noexcept;
template float valve_step<float>(const ValveUnit<float>&, const float&, const float&, const float&) noexcept;
template float valve_ramp<float>(const ValveUnit<float>&, const float&, const float&, const float&,
                                 const float&) noexcept;

template float effect_torque<float>(int, const float*, const JointPoint<float>&, const float*) noexcept;
template void effect_derivative<float>(int, const float*, const JointPoint<float>&, const float*,
                                       float*) noexcept;
template void effect_command<float>(int, const float*, const ValvePoint<float>&, const float*,
                                    float*) noexcept;
template void effect_pressure_rate<float>(int, const float*, const ValvePoint<float>&, const float*,
                                          float*) noexcept;
template void effect_reading<float>(int, const float*, const float&, const float*, Readings<float>&) noexcept;

template Transform<float> dh_transform<float>(const DhLink<float>&, const float&) noexcept;
template InverseKinematics<float> soft_arm_inverse<float>(const SoftArmGeometry<float>&,
                                                          const Transform<float>&,
                                                          const JointVector<float, 6>&) noexcept;
template JointVector<float, 6> gravity_torque<float, 6>(const Chain<float, 6>&,
                                                        const JointVector<float, 6>&) noexcept;

}  // namespace models
}  // namespace isac

/// Entry point for a firmware: 0 when the table at `bytes` is whole and plausible, else the Status that says why not.
extern "C" int isac_check_parameter_table(const unsigned char* bytes, unsigned length) {
  static isac::models::ParameterTable table;
  return static_cast<int>(isac::models::load_parameter_table(
      {reinterpret_cast<const std::byte*>(bytes), static_cast<std::size_t>(length)}, table));
}
