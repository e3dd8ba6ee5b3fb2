/// @file
/// The one door for TOML: toml++ behind errors that say file, line, column, what was found, what would do, and the mend.
///
/// For the readers of this room only (rig, params, model_file, data_tables): it includes toml++. A document's keys are held
/// against the list of what the reader knows, and a misspelt one is answered with its nearest known neighbour. Keys nested
/// deeper than 8 names or brackets deeper than 32 are refused before toml++ sees them, so that no input can exhaust the stack.
/// Threads: values; const access is safe. Throws isac::Error (bad input) everywhere.
/// Example: `TomlSection joint(*root.table("joint"), "joint", file, {"inertia"}); joint.quantity("inertia", dimension::kInertia)`
#pragma once

#include <toml++/toml.h>

#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"

namespace isac::record {

/// The whole file; throws isac::Error when it cannot be read or is larger than 16 MiB.
[[nodiscard]] std::string read_text_file(const std::filesystem::path& path);

[[nodiscard]] toml::table parse_toml(const std::string& text, const std::string& file);

[[noreturn]] void fail_at(const toml::node& node, const std::string& file, std::string code,
                          std::string text);

/// A value's text for messages: `"3 N"`, `38`, `an array`.
[[nodiscard]] std::string shown(const toml::node& node);

class TomlSection {
 public:
  /// `name` is shown in messages: "" for the top of the file, "joint" for [joint]. Unknown keys are refused here, unless
  /// `known` is empty.
  TomlSection(const toml::table& table, std::string name, const std::string& file,
              std::initializer_list<std::string_view> known);

  [[nodiscard]] bool has(std::string_view key) const;
  /// The reader's format word, "isac.rig/1"; another or none is an error.
  void require_format(std::string_view format) const;

  [[nodiscard]] std::optional<std::string> text(std::string_view key) const;
  /// "38 mm" in SI; a bare number, an unknown unit or another dimension is an error.
  [[nodiscard]] std::optional<double> quantity(std::string_view key, const Dimension& dimension) const;
  /// A bare number.
  [[nodiscard]] std::optional<double> number(std::string_view key) const;
  [[nodiscard]] std::optional<bool> boolean(std::string_view key) const;
  [[nodiscard]] std::vector<std::string> texts(std::string_view key) const;
  [[nodiscard]] const toml::table* table(std::string_view key) const;
  /// The tables of `[[key]]`; a single `[key]` counts as one.
  [[nodiscard]] std::vector<const toml::table*> tables(std::string_view key) const;

  [[noreturn]] void fail(std::string_view key, std::string code, std::string text) const;
  [[nodiscard]] const toml::table& raw() const noexcept { return *table_; }

 private:
  [[nodiscard]] const toml::node* find(std::string_view key) const;
  [[nodiscard]] std::string where() const;

  const toml::table* table_;
  std::string name_;
  const std::string* file_;
};

/// A TOML basic string with its quotes, escaped.
[[nodiscard]] std::string toml_string(std::string_view text);
/// A key as TOML wants it: bare where that is allowed, else quoted.
[[nodiscard]] std::string key_text(std::string_view key);

}  // namespace isac::record
