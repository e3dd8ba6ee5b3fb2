#include "isac/runtime/log_writer.hpp"

#include <chrono>

#include "isac/core/units.hpp"

namespace isac::runtime {
namespace {

/// How long either side naps when the ring is empty or (virtual time) full.
constexpr std::chrono::microseconds kNap{500};

}  // namespace

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
    : log_(path, log_columns(shape, raw), metadata), shape_(shape), raw_(raw), ring_(ring_rows) {
  values_.reserve(log_columns(shape, raw).size());
  thread_ = std::thread([this] { write_rows(); });
}

LogWriter::~LogWriter() {
  stop_.store(true, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
}

bool LogWriter::push(const LogRow& row) noexcept {
  if (ring_.push(row)) return true;
  dropped_.fetch_add(1, std::memory_order_relaxed);
  return false;
}

bool LogWriter::push_waiting(const LogRow& row) noexcept {
  while (!ring_.push(row)) {
    if (failed()) return false;
    std::this_thread::sleep_for(kNap);
  }
  return true;
}

std::uint64_t LogWriter::finish() {
  stop_.store(true, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
  if (error_) std::rethrow_exception(error_);
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

void LogWriter::write_rows() noexcept {
  try {
    LogRow row;
    for (;;) {
      const bool last_round = stop_.load(std::memory_order_acquire);  // read before the ring is emptied
      while (ring_.pop(row)) append(row);
      if (last_round) return;
      std::this_thread::sleep_for(kNap);
    }
  } catch (...) {
    error_ = std::current_exception();
    failed_.store(true, std::memory_order_release);
  }
}

}  // namespace isac::runtime
