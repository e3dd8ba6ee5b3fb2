/// @file
/// Columns of a real recording for tests labelled `real`: plain numbers behind one header line, chosen by place.
#pragma once

#include <cstdlib>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <vector>

namespace isac::test {

/// The folder with real recordings, or empty.
inline std::string real_data() {
  const char* folder = std::getenv("ISAC_REAL_DATA");
  return folder ? folder : "";
}

inline std::vector<std::vector<double>> read_columns(const std::string& path) {
  std::ifstream in(path);
  std::string line;
  std::getline(in, line);
  std::vector<std::vector<double>> columns;
  while (std::getline(in, line)) {
    std::stringstream cells(line);
    std::string cell;
    for (std::size_t k = 0; std::getline(cells, cell, ','); ++k) {
      if (columns.size() <= k) columns.emplace_back();
      char* end = nullptr;
      const double value = std::strtod(cell.c_str(), &end);
      columns[k].push_back(end == cell.c_str() ? std::numeric_limits<double>::quiet_NaN() : value);
    }
  }
  return columns;
}

}  // namespace isac::test
