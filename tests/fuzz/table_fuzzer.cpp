// The loader of deployment tables holds for any bytes: it refuses them and leaves the table empty, or what it loaded packs
// to the same bytes. Each input is tried as it is, and again with magic, version, length and checksum made right, so that the
// checks behind them are reached.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "isac/core/crc32.hpp"
#include "isac/models/parameter_table.hpp"
#include "isac/record/tables.hpp"

namespace {

using isac::models::ParameterTable;

void require(bool holds) {
  if (!holds) std::abort();
}

void put(std::vector<std::byte>& bytes, std::size_t at, std::uint64_t value, std::size_t size) {
  for (std::size_t i = 0; i < size; ++i) bytes[at + i] = static_cast<std::byte>(value >> (8 * i));
}

void try_to_load(const std::vector<std::byte>& bytes) {
  ParameterTable table;
  if (!isac::ok(isac::models::load_parameter_table(bytes, table))) {
    require(table == ParameterTable{});
    return;
  }
  require(isac::models::check_parameter_table(table) == isac::Status::kOk);
  require(isac::record::pack_parameter_table(table) == bytes);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::vector<std::byte> bytes(size);
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<std::byte>(data[i]);
  try_to_load(bytes);

  const std::size_t joints = size % 6 + 1, effects = size % 3;
  bytes.resize(isac::models::parameter_table_bytes(static_cast<int>(joints), static_cast<int>(effects)));
  for (std::size_t i = 0; i < 8; ++i)
    bytes[i] = static_cast<std::byte>(isac::models::kParameterTableMagic[i]);
  put(bytes, 8, isac::models::kParameterTableVersion, 2);
  put(bytes, 10, joints, 1);
  put(bytes, 11, effects, 1);
  put(bytes, 12, bytes.size(), 4);
  put(bytes, 16, size % 2, 4);
  put(bytes, 20, 0, 8);
  put(bytes, 28, 0, 4);
  put(bytes, bytes.size() - 4, isac::crc32(std::span(bytes).first(bytes.size() - 4)), 4);
  try_to_load(bytes);
  return 0;
}
