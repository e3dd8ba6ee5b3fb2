/// @file
/// `params.toml` (`isac.params/1`): the identified parameters that every program and the controller read.
///
/// Each value has: value, unit, standard error, 95 % interval, the SHA-256 of the recordings it came from, and the box
/// (Δp, φ, φ̇) in which it holds. Written atomically (temporary file, fsync, rename), the old file kept as `.bak`; reading
/// back gives the same bits. Sections: `[[joint]]` (one per joint), `[pcu]`, `[gains]`, `[masses]`, `[[effects]]`; sections
/// this program does not know are kept and written back with the same values (their comments and order are not kept).
///
/// In the file: `parameters.<name> = { value, unit, std_error, ci95 = [low, high], identifiable, reason or remark }`; the box is
/// `box = { delta_pressure_Pa = [low, high], angle_rad = […], speed_rad_s = […] }`; `constants` carry their SI unit in the name.
/// An unknown number is `nan`. Any other section with `parameters` is read as a ParamsSection too.
/// Threads: pure functions but update_params, which one process at a time may call on one file.
/// Throws isac::Error (bad input) with file, line and column. Source: docs/formats.md.
/// Example: `double A = read_params("params.toml").find("joint", "testbed")->values.at(0).value;`
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "isac/core/estimated.hpp"

namespace isac::record {

struct ParamsSection {
  std::string name;   ///< "joint", "pcu", "gains", "masses", "effects"
  std::string label;  ///< which joint or effect: "testbed", "1", "coulomb_friction"
  std::vector<Estimated> values;
  std::vector<std::string> sources;  ///< "sha256:<64 hex digits> file.csv"
  ValidityBox box;
  std::vector<std::pair<std::string, double>>
      constants;  ///< SI: {"wheel_radius_m", 0.019}, {"initial_pressure_Pa", …}
};

struct Params {
  std::string created;  ///< ISO 8601
  std::vector<ParamsSection> sections;
  std::string other_keys;    ///< TOML text of top-level values that this program does not know, written back
  std::string other_tables;  ///< the same for its sections
  [[nodiscard]] const ParamsSection* find(const std::string& name, const std::string& label = {}) const;
};

[[nodiscard]] Params read_params(const std::filesystem::path& path);
[[nodiscard]] Params parse_params(const std::string& text, const std::string& file_name);
[[nodiscard]] std::string format_params(const Params& params);
/// Replaces sections of the same name and label in the file (if it exists), keeps the others, writes atomically.
void update_params(const std::filesystem::path& path, const Params& fresh);

}  // namespace isac::record
