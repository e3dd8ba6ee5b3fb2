/// @file
/// From `params.toml` to what a controller is given: a C header, a packed binary, and tables for people.
///
/// What is deployed per joint: A, B, C, D (eq 3.10), wheel radius, p0, inertia, the validity box, the valve unit's K_C,
/// T_C and dead time, the controller's gains, and the added effects; for the arm the masses m1…m3. Everything in SI,
/// float64, the same bits in header and binary; the layout stands in models/parameter_table.hpp.
/// Names in `params.toml`:
///  - `[[joint]]` A B C D and other catalogue terms; constants wheel_radius_m, initial_pressure_Pa, inertia_kg_m2;
///  - `[pcu]` K_C, T_C (or T_fill, T_vent), dead_time; its label is a joint's, or none: it holds for all joints;
///  - `[gains]` K_P_position, K_I_position, K_P_torque, K_I_torque; label as for `[pcu]`;
///  - `[masses]` m1 m2 m3; `[[effects]]` label: the effect's id; constant `joint` (from 1), else it holds for all joints.
/// Not identifiable values are left out, and the table's bit mask says so.
/// Threads: pure functions but write_tables. Throws isac::Error: bad input for a unit of the wrong dimension, too many
/// joints and the like; "answer is no" when there is nothing to deploy. Source: seed tables 6.1, 6.2; docs/formats.md.
/// Example: `isac::record::write_tables(read_params("params.toml"), "out/isac_parameters");`
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "isac/core/estimated.hpp"
#include "isac/models/parameter_table.hpp"
#include "isac/record/params.hpp"

namespace isac::record {

struct DeploymentTables {
  std::string header;             ///< C11 and C++20, `static const`, needs only <stdint.h>
  std::vector<std::byte> binary;  ///< magic, version, CRC-32; what models::load_parameter_table reads
  std::string actuator_csv;       ///< like the seed's table 6.1, one row per joint
  std::string control_csv;        ///< like the seed's table 6.2; empty without gains
  std::string markdown;           ///< both tables and the masses, with standard errors
  Warnings warnings;              ///< what was left out, and why
};

/// `source_name` is written into the header's first lines ("params.toml"); nothing in the output depends on
/// the clock.
[[nodiscard]] DeploymentTables make_tables(const Params& params,
                                           const std::string& source_name = "params.toml");

/// Writes `stem`.h, .bin, .md, _actuator.csv and (with gains) _control.csv, each atomically; returns their
/// paths.
std::vector<std::filesystem::path> write_tables(const Params& params, const std::filesystem::path& stem,
                                                const std::string& source_name = "params.toml");

/// The table that `params` mean, in SI. `warnings`, if given, gets what was left out.
[[nodiscard]] models::ParameterTable parameter_table(const Params& params, Warnings* warnings = nullptr);
/// The packed binary; load_parameter_table gives the same table back.
[[nodiscard]] std::vector<std::byte> pack_parameter_table(const models::ParameterTable& table);

}  // namespace isac::record
