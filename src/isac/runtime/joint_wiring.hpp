/// @file
/// Which channels of the card belong to which joint, and what their codes mean; for one joint or the six of an arm.
///
///   physical = (code − offset) · gain        angle = (count − middle) · 2π / steps_per_turn
/// One joint: the signals of isac-log (angle, p1, p2, F1, F2, p1_cmd, p2_cmd); the sensors may be missing. Several joints: the
/// pin table of the controller card (data/controller_card_pins.toml), joint k from 1 on encoder k−1 and outputs 2(k−1) and
/// 2(k−1)+1, unless [[calibration]] names phi<k>, p1_cmd<k>, p2_cmd<k> (and p1_<k>, p2_<k>, F1_<k>, F2_<k> where measured).
///
/// Units: SI, counts. Real time: reading and writing codes is constant time, no heap, noexcept; making the wiring is not.
/// Threads: a value. Errors: wire_joints throws isac::Error (bad input) that names the signal or the channel the card lacks,
/// or a card whose codes the testbed's calibration does not describe.
/// Source: seed C.4, table C.5, E.1.4. Example: `auto wiring = wire_joints(rig, card->shape(), 1);`
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "isac/card/card.hpp"
#include "isac/record/rig.hpp"

namespace isac::runtime {

inline constexpr int kMaxJoints = 6;
template <class T>
using PerJoint = std::array<T, static_cast<std::size_t>(kMaxJoints)>;

/// One input or output; channel −1: not there.
struct CodeLine {
  int channel = -1;
  double offset = 0, gain = 1;
  [[nodiscard]] bool wired() const noexcept { return channel >= 0; }
  [[nodiscard]] std::size_t index() const noexcept { return static_cast<std::size_t>(channel); }
  [[nodiscard]] double value(std::uint32_t code) const noexcept {
    return (static_cast<double>(code) - offset) * gain;
  }
  /// What the inputs show, or NaN where nothing is wired.
  [[nodiscard]] double value(const std::array<std::uint32_t, card::kInputs>& codes) const noexcept {
    return wired() ? value(codes[index()]) : std::numeric_limits<double>::quiet_NaN();
  }
  /// Rounded and clamped to 0 … `max_code`; what is not a number gives 0: vented.
  [[nodiscard]] std::uint32_t code(double physical, std::uint32_t max_code) const noexcept {
    const double wanted = std::round(physical / gain + offset);
    if (!(wanted > 0.0)) return 0;
    return wanted >= static_cast<double>(max_code) ? max_code : static_cast<std::uint32_t>(wanted);
  }
};

struct JointLines {
  int encoder = -1;
  double radian_per_count = 0;
  double middle = 0;          ///< count at φ = 0
  CodeLine valve_1, valve_2;  ///< outputs
  CodeLine p1, p2, F1, F2;    ///< inputs, where there are sensors
  [[nodiscard]] bool measures_force() const noexcept { return F1.wired() && F2.wired(); }
  [[nodiscard]] bool measures_pressure() const noexcept { return p1.wired() && p2.wired(); }
};

struct JointWiring {
  int joints = 0;
  card::Shape shape;
  PerJoint<JointLines> joint;
};

[[nodiscard]] JointWiring wire_joints(const record::Rig& rig, const card::Shape& shape, int joints);

}  // namespace isac::runtime
