/// @file
/// The words behind "sim:arm=FILE,…" and the card of the simulated six-joint arm, in virtual time.
///
///   enc0 … enc5   φ of the actuators, 8000 steps a turn, rounded down (seed C.4)
///   ao2j, ao2j+1  reference pressures of muscles 1 and 2 of joint j, 4095 codes for 5 kg/cm² (seed C.4)
///
/// | option | unit | meaning |
/// | --- | --- | --- |
/// | arm=FILE | | arm.toml of the arm as it truly is: lengths, masses, actuators; six joints |
/// | friction=X | - | Dahl's, as a share of each joint's torque at Δp = 2 kg/cm² (0.01) |
/// | load=X | kg | in the hand (0) |
/// | pull=J:X, spring=J:X | N m, N m/rad | a hose on joint J: pull − spring φ; may be given for several joints |
/// | zero=J:X | rad | the encoder of joint J reads φ + X |
/// | inertia=X | kg m2 | each joint's own (0.002) |
/// | T_C=X | s | lag of all valve units (0.17) |
/// | valve_scatter=X | kg/cm2 | standard deviation of each valve's own offset (0) |
/// | seed=N | | of that scatter |
///
/// The arm has no pressure sensors, as the seed's: what a joint's muscles get is what they were told, once the valves have
/// settled. Units: as card.hpp. Real time: as card.hpp; its cost is the integrator's. Threads: one drives; vent() may come from
/// another and acts at the next call. Errors: opening throws isac::Error: usage for a word, bad input for the file.
/// Source: seed C.4, 6.2; simulate/arm_plant.hpp. Example: `card::open("sim:arm=data/arms/right_soft_arm.toml,friction=0.01")`.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string_view>

#include "isac/card/card.hpp"
#include "isac/simulate/arm_plant.hpp"

namespace isac::card {

struct SimArmConfig {
  simulate::ArmPlantConfig plant;
  simulate::ArmVector encoder_zero{};  ///< rad, added to what is read
};

/// `text` is what follows "sim:"; true where one of its words is `arm=`.
[[nodiscard]] bool names_an_arm(std::string_view text);
[[nodiscard]] SimArmConfig parse_sim_arm(std::string_view text);
/// One line per option.
[[nodiscard]] std::string sim_arm_help();

[[nodiscard]] Opened open_sim_arm(std::string_view text);

class SimArmCard final : public Card {
 public:
  static constexpr std::uint32_t kEncoderModulus = 1u << 24;
  static constexpr std::uint32_t kMaxValveCode = 4095;

  /// Shares the plant, so that whoever made it can look at it. `encoder_zero` in rad is added to what is read.
  SimArmCard(std::shared_ptr<simulate::ArmPlant> plant, const simulate::ArmVector& encoder_zero);
  ~SimArmCard() override;
  SimArmCard(const SimArmCard&) = delete;
  SimArmCard& operator=(const SimArmCard&) = delete;

  [[nodiscard]] Shape shape() const noexcept override;
  Status wait_until(std::int64_t time_ns) noexcept override;
  Status read(Sample& sample) noexcept override;
  Status write(const Command& command) noexcept override;
  Status vent() noexcept override;
  Status outputs(Command& command) const noexcept override;

 private:
  void apply_vent() noexcept;
  void command_plant() noexcept;

  simulate::ArmVector encoder_zero_;
  std::shared_ptr<simulate::ArmPlant> plant_;
  Command outputs_;
  std::int64_t now_ns_ = 0, last_stamp_ns_ = -1;
  std::atomic<bool> vent_asked_{false};
};

}  // namespace isac::card
