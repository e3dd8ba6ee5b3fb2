/// @file
/// Noise of the recordings. Forces in N, pressures in kg/cm2, torques in N m.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "random.hpp"
#include "rig.hpp"

namespace blind {

/// Standard deviations. A coloured part is an Ornstein-Uhlenbeck process of the memory given beside it.
struct Noise {
  std::string kind = "white";                                           ///< white, coloured, quantised, real
  double force_white = 0.3, force_wander = 0.0, wander_memory = 100.0;  ///< on each force
  double torque_coloured = 0.0, torque_memory = 0.1;                    ///< on F2 − F1
  double pressure_white = 0.004, pressure_coloured = 0.0, pressure_memory = 0.1;
  double force_step = 0.0, pressure_step = 0.0;           ///< of the 12-bit converter; 0: none
  bool jitter = false;                                    ///< time stamps off by some µs
  std::vector<double> recorded_force, recorded_pressure;  ///< `real`: residuals of sd one

  [[nodiscard]] double torque_floor(double r) const;         ///< sd of r (F2 − F1), N m
  [[nodiscard]] double pressure_floor() const;               ///< sd of a pressure
  [[nodiscard]] double balance_floor(const Rig& rig) const;  ///< sd of torque − I φ̈, see baseline.hpp
};

/// Sizes are drawn around the rig's. `real` needs the folder of real recordings; throws std::runtime_error without.
Noise draw_noise(const std::string& kind, const Rig& rig, Random& random,
                 const std::filesystem::path& recordings);

/// Noise, steps of converter and encoder added. The encoder's reading is the middle of the step it is in.
Signals add_noise(const Signals& clean, const Noise& noise, const Rig& rig, Random& random);

/// x_k+1 = e^(−dt/memory) x_k + …, stationary from the first value on, standard deviation `sd`.
std::vector<double> ornstein_uhlenbeck(std::size_t count, double sd, double memory, Random& random);

/// Blocks of `recorded`, each from a drawn place (going round at its end, so that every value is as likely) and with a
/// drawn sign, until `count` are there.
std::vector<double> block_bootstrap(const std::vector<double>& recorded, std::size_t count, std::size_t block,
                                    Random& random);

}  // namespace blind
