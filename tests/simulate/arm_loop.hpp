/// @file
/// The simulated Soft Arm under its controller: 2 kHz and 0.2 kHz, encoders of 8000 steps, speeds derived from them.
#pragma once

#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "isac/control/arm_controller.hpp"
#include "isac/control/trajectory.hpp"
#include "isac/control/velocity_estimate.hpp"
#include "isac/core/units.hpp"
#include "isac/simulate/arm_plant.hpp"
#include "soft_arm.hpp"

namespace isac::test {

using simulate::ArmVector;
using simulate::kArmJoints;

/// Table 6.2: N m/rad, N m/(rad s), kg/cm² per N m, per N m and s.
inline constexpr double kGains[kArmJoints][4] = {{200, 80, 0.0065, 10}, {100, 25, 0.03, 10},
                                                 {25, 10, 0.12, 5},     {25, 10, 0.12, 5},
                                                 {8, 2, 0.4, 10},       {8, 2, 0.4, 10}};

struct ArmSample {
  double time = 0;  ///< s
  ArmVector angle{}, wanted{};
  models::Vec3<double> tool{}, wanted_tool{};
};

class ArmLoop {
 public:
  static constexpr double kTick = 5e-4;

  /// `known`: the arm as the controller believes it to be.
  ArmLoop(const simulate::ArmPlantConfig& truth, const simulate::ArmPlantConfig& known, control::Mode mode)
      : plant_(truth), known_(known) {
    controller.chain = known.chain;
    controller.coupling = known.coupling;
    for (std::size_t i = 0; i < kArmJoints; ++i) {
      control::JointSettings<double> s;
      s.muscle = known.joints[i].muscle;
      s.wheel_radius = known.joints[i].wheel_radius;
      s.position = {.proportional = kGains[i][0], .integral = kGains[i][1]};
      s.torque = {.proportional = kGains[i][2] * kPascalPerKgfCm2,
                  .integral = kGains[i][3] * kPascalPerKgfCm2};
      s.limits.angle_low = -kPi;
      s.limits.angle_high = kPi;
      settings.at(i) = s;
    }
    mode_ = mode;
  }

  /// Held at `angle` by hand for `seconds` while the loops and valves come to rest, then let go.
  void start(const ArmVector& angle, double seconds = 2) {
    for (std::size_t i = 0; i < kArmJoints; ++i) {
      require(controller.joints[i].configure(settings[i]));
      require(controller.joints[i].set_mode(mode_));
    }
    plant_.rest_at(angle, 3 * kPascalPerKgfCm2);
    plant_.hold(true);
    rest_.angle = angle;
    run(seconds, [this](double) { return rest_; });
    plant_.hold(false);
  }

  /// Runs with the joints' desired motion over time since the call; `act` may push the plant before each tick.
  std::vector<ArmSample> run(double seconds, const std::function<control::LinePoint<double>(double)>& wanted,
                             const std::function<void(double, simulate::ArmPlant&)>& act = nullptr) {
    std::vector<ArmSample> samples;
    const int ticks = static_cast<int>(std::lround(seconds / kTick));
    for (int k = 0; k < ticks; ++k) {
      const double t = k * kTick;
      if (act) act(t, plant_);
      const control::LinePoint<double> aim = wanted(t);
      std::array<control::JointMeasurement<double>, kArmJoints> now{};
      std::array<control::ArmReference<double>, kArmJoints> reference{};
      for (std::size_t i = 0; i < kArmJoints; ++i) {
        now[i].angle = encoder_step > 0 ? std::floor(plant_.angle()[i] / encoder_step) * encoder_step
                                        : plant_.angle()[i];
        require(speed_[i].step(now[i].angle, kTick, now[i].velocity));
        reference[i] = {
            .angle = aim.angle[i], .velocity = aim.velocity[i], .acceleration = aim.acceleration[i]};
      }
      std::array<control::JointCommand<double>, kArmJoints> command;
      int failed = -1;
      require(controller.step(now, reference, kTick, command, failed));
      simulate::ArmPressures u;
      ArmSample sample{.time = t, .angle = plant_.angle(), .wanted = aim.angle, .tool = plant_.tool()};
      sample.wanted_tool =
          models::tool_position(known_.chain, models::multiply<double, 6>(known_.coupling, aim.angle));
      for (std::size_t i = 0; i < kArmJoints; ++i) u[i] = command[i].pressure;
      samples.push_back(sample);
      plant_.command(u);
      require(plant_.run(kTick));
    }
    return samples;
  }

  [[nodiscard]] const simulate::ArmPlant& plant() const noexcept { return plant_; }
  [[nodiscard]] const control::LinePoint<double>& rest() const noexcept { return rest_; }

  control::ArmController<double, 6> controller;
  std::array<control::JointSettings<double>, kArmJoints> settings;  ///< taken by start()
  double encoder_step = 2 * kPi / 8000;                             ///< rad; 0: exact angles

 private:
  static void require(Status status) {
    if (!ok(status)) throw std::runtime_error(std::string("the arm's loop: ") + describe(status));
  }

  simulate::ArmPlant plant_;
  simulate::ArmPlantConfig known_;
  std::array<control::VelocityEstimate<double>, kArmJoints> speed_;
  control::LinePoint<double> rest_;
  control::Mode mode_;
};

/// Printed when ISAC_SHOW is set: the numbers of docs/arm.md.
template <class... T>
void show(const char* format, T... values) {
  if (std::getenv("ISAC_SHOW") != nullptr) std::printf(format, values...);
}

/// r of table 6.1 as the errata read it, or twice that; friction as a share of the torque of 2 kg/cm²; share of table 6.2's
/// outer gains; T_C of the valves; how many times table 6.1's D the joints truly have, and the
/// controller's model.
struct Arm {
  const char* name = "";
  double radius = 1, friction = 0, gains = 1, lag = 0.17, damping = 1, known = 1;
};
inline constexpr Arm kDiameter{"diameter", 1, 0.01, 0.25}, kRadius{"radius", 2, 0.01, 1},
    kRubbing{"radius, rubbing", 2, 0.03, 1}, kDamped{"radius, damped", 2, 0.003, 1, 0.17, 11};

inline double full_torque(const simulate::ArmJointConfig& joint) {
  return joint.muscle.B * joint.wheel_radius * 2 * kPascalPerKgfCm2;
}

/// As the controller believes it to be.
inline simulate::ArmPlantConfig build(const Arm& arm) {
  simulate::ArmPlantConfig config = soft_arm_config();
  for (simulate::ArmJointConfig& joint : config.joints) {
    joint.wheel_radius *= arm.radius;
    joint.friction = arm.friction * full_torque(joint);
    for (simulate::ValveUnit& valve : joint.valve) valve.fill_lag = valve.vent_lag = arm.lag;
  }
  return config;
}

/// As it is: with the damping that the controller's model does not know.
inline simulate::ArmPlantConfig true_arm(const Arm& arm) {
  simulate::ArmPlantConfig config = build(arm);
  for (simulate::ArmJointConfig& joint : config.joints) joint.muscle.D *= arm.damping;
  return config;
}

inline double length(const models::Vec3<double>& a) {
  return std::sqrt(dot(a, a));
}

inline ArmLoop loop_of(const simulate::ArmPlantConfig& truth, const Arm& arm,
                       control::Mode mode = control::Mode::kPosition) {
  ArmLoop loop(truth, build(arm), mode);
  for (auto& joint : loop.settings) {
    joint.position.proportional *= arm.gains;
    joint.position.integral *= arm.gains;
    joint.muscle.C *= arm.known;
    joint.muscle.D *= arm.known;
  }
  return loop;
}

}  // namespace isac::test
