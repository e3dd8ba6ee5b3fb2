/// @file
/// A folder with the testbed's rig file and parameters, and isac-tune called in it as a person calls it.
#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "run_program.hpp"

namespace isac::test {

inline constexpr const char* kTuneRig = R"(format = "isac.rig/1"
name = "testbed"

[joint]
chain_wheel_diameter = "38 mm"
initial_pressure = "3.0 kg/cm2"
inertia = "0.0085 kg m2"
)";

inline constexpr const char* kTuneParams = R"(format = "isac.params/1"
created = "2026-01-02T03:04:05Z"

[[joint]]
label = "testbed"
constants = { wheel_radius_m = 0.019, initial_pressure_Pa = 294199.5, inertia_kg_m2 = 0.0085 }
[joint.parameters]
A = { value = -23450.0, unit = "N/m", std_error = 120 }
B = { value = 174.2, unit = "N cm2/kg", std_error = 0.9 }
C = { value = 0.0026, unit = "N m s3", std_error = 0.0003 }
D = { value = 0.14, unit = "N m s", std_error = 0.003 }

[pcu]
[pcu.parameters]
T_C = { value = 0.17, unit = "s", std_error = 0.001 }

[gains]
[gains.parameters]
K_P_position = { value = 4.0, unit = "N m/rad" }
K_I_position = { value = 8.0, unit = "N m/rad s" }
K_P_torque = { value = 0.1, unit = "kgf/cm2/N m" }
K_I_torque = { value = 10.0, unit = "kgf/cm2/N m s" }
)";

class TuneFolder : public testing::Test {
 protected:
  TuneFolder() {
    std::ofstream(folder_ / "rig.toml") << kTuneRig;
    std::ofstream(folder_ / "params.toml") << kTuneParams;
  }
  [[nodiscard]] std::vector<std::string> words(const std::vector<std::string>& more) const {
    std::vector<std::string> all = {"isac-tune", "--rig", folder_ / "rig.toml"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  [[nodiscard]] test::Run tune(const std::vector<std::string>& more) const {
    return run_program(words(more));
  }
  [[nodiscard]] nlohmann::json answer() const {
    return nlohmann::json::parse(read_text(folder_ / "answer.json"));
  }
  ScratchFolder folder_;
};

}  // namespace isac::test
