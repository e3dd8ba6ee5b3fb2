#include "isac/series/recording.hpp"

#include "isac/core/error.hpp"

namespace isac::series {

const Column* Recording::find(std::string_view name) const noexcept {
  for (const Column& column : columns) {
    if (column.name == name) return &column;
  }
  return nullptr;
}

const Column& Recording::column(std::string_view name) const {
  if (const Column* found = find(name)) return *found;
  std::string have;
  for (const Column& column : columns) have += (have.empty() ? "" : ", ") + column.name;
  throw Error(ErrorKind::kBadInput, "column_missing",
              "needs a column '" + std::string(name) + "' but has only " + have + "; add it, or name the column that " +
                  "holds it with --map " + std::string(name) + "=\"<header>\":<unit>",
              {source, 0, 0});
}

std::string Recording::meta(const std::string& key, const std::string& fallback) const {
  const auto found = metadata.find(key);
  return found == metadata.end() ? fallback : found->second;
}

}  // namespace isac::series
