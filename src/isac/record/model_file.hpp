/// @file
/// `model.toml` (`isac.model/1`): a baseline other than the seed's A, B, C, D, as a sum of catalogue terms
/// and an output.
///
///   output = Σ term(position, velocity, acceleration, …),   terms by their ids in models/effects.hpp
///
/// So a user with any single joint (an axis with a motor, a pendulum, one muscle) can ask the same questions.
/// A term that the catalogue does not know, an unknown key or a unit that is none is an error with line,
/// column and the nearest known word. Threads: pure functions. Throws isac::Error (bad input). Source:
/// docs/formats.md, docs/effects.md "Baselines". Example: `auto model =
/// isac::record::read_model("model.toml"); options.terms = model.terms;`
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace isac::record {

struct ModelFile {
  std::string name;                      ///< optional, for titles
  std::string output_signal = "torque";  ///< the column that the terms sum up to
  std::string output_unit = "N m";       ///< its unit; the residuals are reported in it
  std::string position = "angle";        ///< the column of the coordinate
  std::vector<std::string> terms;        ///< catalogue ids or the aliases A, B, C, D; at least one
};

[[nodiscard]] ModelFile read_model(const std::filesystem::path& path);
[[nodiscard]] ModelFile parse_model(const std::string& text, const std::string& file_name);
/// The text of a `model.toml` that parse_model reads back to the same values.
[[nodiscard]] std::string format_model(const ModelFile& model);

}  // namespace isac::record
