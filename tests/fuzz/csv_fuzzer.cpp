// The CSV door holds for any bytes: it reads them or throws one isac::Error in one line with a place inside the file, and
// says the same whatever the sizes of pieces and blocks.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <string>
#include <string_view>

#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/csv_reader.hpp"

namespace {

using isac::series::Recording;

void require(bool holds) {
  if (!holds) std::abort();
}

struct Outcome {
  std::string error;
  std::size_t rows = 0;
  double sum = 0.0;
  std::map<std::string, std::string> metadata;
  std::string sha256;
  friend bool operator==(const Outcome&, const Outcome&) = default;
};

Outcome read(std::string_view bytes, bool require_time, std::size_t block_rows, std::size_t piece) {
  Outcome outcome;
  isac::record::ReadOptions options;
  options.require_time = require_time;
  try {
    auto reader = isac::record::BlockReader::of_bytes(bytes, "fuzz.csv", options, block_rows, piece);
    Recording block;
    double last_time = -HUGE_VAL;
    while (reader.next(block)) {
      outcome.rows += block.rows();
      for (const auto& column : block.columns) {
        require(column.values.size() == block.rows());
        const auto unit = isac::parse_unit(column.unit);
        require(column.unit.empty() || (unit && unit->scale == 1.0 && unit->offset == 0.0));
        for (double value : column.values) {
          require(!std::isinf(value));
          if (!std::isnan(value)) outcome.sum += std::remainder(value, 1024.0);
        }
      }
      if (const auto* time = block.find("time")) {
        require(time == block.columns.data());
        for (double t : time->values) {
          require(t > last_time);
          last_time = t;
        }
      }
    }
    outcome.metadata = block.metadata;
    outcome.sha256 = block.sha256;
    require(outcome.rows > 0 && outcome.sha256.size() == 64);
  } catch (const isac::Error& error) {
    outcome = {};
    outcome.error = error.code() + ": " + error.what();
    require(error.kind() == isac::ErrorKind::kBadInput && !error.code().empty());
    require(error.text().find_first_of("\n\r") == std::string::npos && error.text().size() < 1000);
    const long lines = 1 + std::count(bytes.begin(), bytes.end(), '\n');
    require(error.place().line >= 0 && error.place().line <= lines + 1 && error.place().column >= 0);
  }
  return outcome;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  for (const bool require_time : {true, false}) {
    const Outcome whole = read(bytes, require_time, 1U << 20U, 1U << 18U);
    require(read(bytes, require_time, 1U << 20U, 1 + size % 37) == whole);
    const Outcome blocks = read(bytes, require_time, 1 + size % 5, 64);
    require(blocks.error == whole.error && blocks.rows == whole.rows && blocks.sha256 == whole.sha256);
  }
  return 0;
}
