// What was read and is written reads back as the same bits, names, units and metadata.
#include <unistd.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>

#include "isac/core/error.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/record/csv_writer.hpp"

namespace {

void require(bool holds) {
  if (!holds) std::abort();
}

bool same_bits(double a, double b) {
  return (std::isnan(a) && std::isnan(b)) ||
         std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("isac_writer_fuzzer_" + std::to_string(::getpid()) + ".csv");
  isac::record::ReadOptions options;
  options.require_time = false;
  options.hash = false;
  isac::series::Recording first;
  try {
    first = isac::record::parse_recording({reinterpret_cast<const char*>(data), size}, "fuzz.csv", options);
  } catch (const isac::Error&) {
    return 0;  // csv_fuzzer looks at these
  }
  isac::record::write_recording(path, first);
  const auto second = isac::record::read_recording(path, options);
  std::filesystem::remove(path);
  require(first.metadata == second.metadata && first.columns.size() == second.columns.size());
  for (std::size_t c = 0; c < first.columns.size(); ++c) {
    const auto& a = first.columns[c];
    const auto& b = second.columns[c];
    require(a.name == b.name && a.unit == b.unit && a.values.size() == b.values.size());
    for (std::size_t i = 0; i < a.values.size(); ++i) require(same_bits(a.values[i], b.values[i]));
  }
  return 0;
}
