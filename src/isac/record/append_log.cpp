#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <chrono>
#include <cmath>
#include <ctime>
#include <limits>
#include <utility>

#include "isac/core/error.hpp"
#include "isac/record/atomic_file.hpp"
#include "isac/record/csv_format.hpp"
#include "isac/record/csv_text.hpp"
#include "isac/record/csv_writer.hpp"

namespace isac::record {
namespace {

using Clock = std::chrono::steady_clock;

std::string iso_time_now() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  ::gmtime_r(&now, &parts);
  std::string text(32, '\0');
  text.resize(std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &parts));
  return text;
}

bool is_own_key(const std::string& key) {
  return key == "log" || key == "closed" || key == "torn_line";
}

}  // namespace

struct AppendLog::State {
  State(const std::filesystem::path& path, std::vector<LogColumn> log_columns, double sync_seconds)
      : name(path.string()),
        columns(std::move(log_columns)),
        sync_period(std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(sync_seconds))),
        last_sync(Clock::now()) {
    for (std::size_t i = 0; i < columns.size(); ++i) {
      if (columns[i].name == "time") time = i;
    }
  }
  ~State() {
    if (descriptor >= 0) ::close(descriptor);
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  // A recording is never overwritten; an empty file, a pipe or a device may be written to.
  void open(const std::filesystem::path& path) {
    descriptor = ::open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_APPEND | O_CLOEXEC, 0666);
    created = descriptor >= 0;
    if (created) return;
    if (errno != EEXIST) refuse_write(name, errno);
    struct stat status {};
    if (::stat(path.c_str(), &status) == 0 && S_ISREG(status.st_mode) && status.st_size > 0) {
      throw Error(ErrorKind::kUsage, "file_exists",
                  "exists already and a recording is never overwritten; choose another name or remove it",
                  {name, 0, 0});
    }
    descriptor = ::open(path.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
    if (descriptor < 0) refuse_write(name, errno);
  }

  // Hands whole lines to the kernel, or takes back what part of them went out, and throws.
  void put(std::string_view lines) {
    std::size_t written = 0;
    if (const int error = write_all(descriptor, lines, written)) {
      if (written > 0 && ::ftruncate(descriptor, static_cast<off_t>(size)) != 0) {
        // Not a file that can be shortened (a pipe): what went out is gone, and the reader drops the torn line.
      }
      ::close(std::exchange(descriptor, -1));
      refuse_write(name, error);
    }
    size += lines.size();
  }

  void sync() {
    if (::fdatasync(descriptor) != 0 && errno != EINVAL && errno != EROFS)
      refuse_write(name, errno);  // EINVAL: a pipe or device
    last_sync = Clock::now();
  }

  // The reader insists on increasing time, so a row that would print the same time again is refused where it is written.
  void check_time(std::string_view printed) {
    double now = 0.0;
    std::from_chars(printed.data(), printed.data() + printed.size(), now);
    if (!(now > last_time)) {
      throw Error(
          ErrorKind::kBadInput, "time_not_increasing",
          "time " + std::string(printed) + " follows " + shortest(last_time) +
              " but must strictly increase; log each instant once, and write time with enough decimals",
          {name, 0, 0});
    }
    last_time = now;
  }

  std::string name;
  std::vector<LogColumn> columns;
  Clock::duration sync_period;
  Clock::time_point last_sync;
  std::size_t time = std::numeric_limits<std::size_t>::max();
  double last_time = -std::numeric_limits<double>::infinity();
  int descriptor = -1;
  bool created = false;
  std::uint64_t size = 0;
  std::uint64_t rows = 0;
  std::string line;
};

AppendLog::AppendLog(const std::filesystem::path& path, std::vector<LogColumn> columns,
                     const std::map<std::string, std::string>& metadata, double sync_seconds)
    : state_(std::make_unique<State>(path, std::move(columns), sync_seconds)) {
  std::string head = metadata_line("log", "append-only", state_->name);
  for (const auto& [key, value] : metadata) {
    if (!is_own_key(key)) head += metadata_line(key, value, state_->name);
  }
  std::vector<std::pair<std::string, std::string>> header;
  for (const LogColumn& column : state_->columns) header.emplace_back(column.name, column.unit);
  head += header_line(header, state_->name);

  state_->open(path);
  try {
    state_->put(head);
    state_->sync();
  } catch (const Error&) {
    if (state_->created) ::unlink(path.c_str());
    throw;
  }
}

AppendLog::~AppendLog() {
  try {
    close();
  } catch (const Error&) {
    // Nobody is left to tell; the rows written so far are whole.
  }
}

void AppendLog::append(std::span<const double> row) {
  State& log = *state_;
  if (log.descriptor < 0) {
    throw Error(ErrorKind::kBadInput, "log_closed", "the log is closed; open a new one to write more rows",
                {log.name, 0, 0});
  }
  if (row.size() != log.columns.size()) {
    throw Error(ErrorKind::kBadInput, "row_length",
                "a row of " + std::to_string(row.size()) + " values was given to a log of " +
                    std::to_string(log.columns.size()) + " columns; give one value for each column",
                {log.name, 0, 0});
  }
  log.line.clear();
  for (std::size_t i = 0; i < row.size(); ++i) {
    if (i > 0) log.line += ',';
    const std::size_t begin = log.line.size();
    // An infinite sample is as good as none, and the reader would refuse it.
    append_number(log.line, std::isinf(row[i]) ? std::numeric_limits<double>::quiet_NaN() : row[i],
                  log.columns[i].decimals);
    if (i == log.time) log.check_time(std::string_view(log.line).substr(begin));
  }
  log.line += '\n';
  log.put(log.line);
  ++log.rows;
  if (Clock::now() - log.last_sync >= log.sync_period) log.sync();
}

void AppendLog::close() {
  State& log = *state_;
  if (log.descriptor < 0) return;
  log.put(metadata_line("closed", iso_time_now(), log.name));
  log.sync();
  if (::close(std::exchange(log.descriptor, -1)) != 0) refuse_write(log.name, errno);
}

std::uint64_t AppendLog::rows() const noexcept {
  return state_->rows;
}

}  // namespace isac::record
