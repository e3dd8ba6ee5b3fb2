#include "isac/runtime/log_writer.hpp"

#include "isac/core/units.hpp"

namespace isac::runtime {

std::vector<record::LogColumn> log_columns(const card::Shape& shape, bool raw) {
  std::vector<record::LogColumn> columns = {
      {"time", "s", 7}, {"angle", "rad", 7}, {"p1", "kg/cm2", 6},     {"p2", "kg/cm2", 6},
      {"F1", "N", 5},   {"F2", "N", 5},      {"p1_cmd", "kg/cm2", 6}, {"p2_cmd", "kg/cm2", 6},
  };
  if (!raw) return columns;
  const auto add = [&columns](const char* prefix, int count) {
    for (int i = 0; i < count; ++i) columns.push_back({prefix + std::to_string(i), "count", 0});
  };
  add("enc", shape.encoders);
  add("ai", shape.inputs);
  add("ao", shape.outputs);
  return columns;
}

LogWriter::LogWriter(const std::filesystem::path& path, const std::map<std::string, std::string>& metadata,
                     const card::Shape& shape, bool raw, std::size_t ring_rows)
    : log_(path, log_columns(shape, raw), metadata),
      shape_(shape),
      raw_(raw),
      writer_([this](const LogRow& row) { append(row); }, ring_rows) {}

std::uint64_t LogWriter::finish() {
  writer_.finish();
  log_.close();
  return log_.rows();
}

void LogWriter::append(const LogRow& row) {
  values_.assign({row.time, row.physical.angle, row.physical.p1 / kPascalPerKgfCm2,
                  row.physical.p2 / kPascalPerKgfCm2, row.physical.F1, row.physical.F2,
                  row.commanded.p1 / kPascalPerKgfCm2, row.commanded.p2 / kPascalPerKgfCm2});
  if (raw_) {
    const auto add = [this](const auto& codes, int count) {
      for (int i = 0; i < count; ++i)
        values_.push_back(static_cast<double>(codes[static_cast<std::size_t>(i)]));
    };
    add(row.sample.encoder, shape_.encoders);
    add(row.sample.input, shape_.inputs);
    add(row.command.output, shape_.outputs);
  }
  log_.append(values_);
}

}  // namespace isac::runtime
