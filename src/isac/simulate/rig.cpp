#include "isac/simulate/rig.hpp"

#include <algorithm>
#include <cmath>

namespace isac::simulate {

Rig::Rig(const RigConfig& config)
    : config_(config),
      wiring_(wiring_of(config)),
      plant_(config),
      sensors_(config),
      hand_(config.hand, config.seed) {
  sensors_.track(plant_.state());
}

Status Rig::advance_to(double time) noexcept {
  while (plant_.time() < time) {
    if (const Status status = plant_.step_to(time); !ok(status)) return status;
    sensors_.track(plant_.state());
  }
  return Status::kOk;
}

Status Rig::command(const std::array<std::uint32_t, 2>& codes) noexcept {
  std::array<double, 2> pressure{};
  for (std::size_t i = 0; i < 2; ++i) {
    if (codes[i] > kMaxValveCode) return Status::kOutOfRange;
    // Code 0 is the vented valve whatever its zero trimmer says.
    const double code = static_cast<double>(codes[i]);
    if (codes[i] > 0) pressure[i] = std::max(0.0, (code - wiring_.valve[i].offset) * wiring_.valve[i].gain);
  }
  plant_.command(pressure);
  return Status::kOk;
}

double Rig::rest_angle() const noexcept {
  const JointConfig& j = config_.joint;
  const auto& p = plant_.commanded();
  const double delta = 0.5 * (p[1] - p[0]) * config_.valves[0].gain;
  return std::clamp(-j.B * delta / (j.A * j.wheel_radius), -config_.hand.end_position,
                    config_.hand.end_position);
}

void Rig::sweep(Sweep sweep) noexcept {
  if (!std::isfinite(sweep.middle)) sweep.middle = rest_angle();
  const PlantState now = plant_.state();
  hand_.sweep(now.time, now.joint, held_, sweep);
  held_ = true;
  plant_.hold(&hand_);
}

void Rig::hold(double angle, bool clamp) noexcept {
  const PlantState now = plant_.state();
  hand_.hold(now.time, now.joint, held_, angle, clamp);
  held_ = true;
  plant_.hold(&hand_);
}

void Rig::release() noexcept {
  held_ = false;
  plant_.hold(nullptr);
}

}  // namespace isac::simulate
