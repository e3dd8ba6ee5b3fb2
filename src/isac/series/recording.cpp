#include "isac/series/recording.hpp"

#include <algorithm>

#include "isac/core/error.hpp"

namespace isac::series {
namespace {

char lower(char c) noexcept {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

bool differs_in_capitals_only(std::string_view a, std::string_view b) noexcept {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](char x, char y) { return lower(x) == lower(y); });
}

}  // namespace

const Column* Recording::find(std::string_view name) const noexcept {
  for (const Column& column : columns) {
    if (column.name == name) return &column;
  }
  return nullptr;
}

const Column& Recording::column(std::string_view name) const {
  if (const Column* found = find(name)) return *found;
  std::string have;
  std::string meant;
  for (const Column& column : columns) {
    have += (have.empty() ? "only " : ", ") + column.name;
    if (differs_in_capitals_only(column.name, name)) meant = " (did you mean '" + column.name + "'?)";
  }
  throw Error(ErrorKind::kBadInput, "column_missing",
              "needs a column '" + std::string(name) + "' but has " + (have.empty() ? "none" : have) + meant +
                  "; add it, or name the column that holds it with --map " + std::string(name) +
                  "=\"<header>\":<unit>",
              {source, 0, 0});
}

std::string Recording::meta(const std::string& key, const std::string& fallback) const {
  const auto found = metadata.find(key);
  return found == metadata.end() ? fallback : found->second;
}

}  // namespace isac::series
