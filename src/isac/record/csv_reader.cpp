#include "isac/record/csv_reader.hpp"

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include "isac/record/byte_source.hpp"
#include "isac/record/csv_header.hpp"
#include "isac/record/csv_metadata.hpp"
#include "isac/record/csv_rows.hpp"
#include "isac/record/csv_text.hpp"

namespace isac::record {
namespace {

std::string_view without_carriage_return(std::string_view line) noexcept {
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

// The first line of `text` that is neither blank nor a remark and ends with a line feed, or nothing.
std::string_view first_row(std::string_view text) noexcept {
  while (!text.empty()) {
    const std::size_t stop = text.find('\n');
    if (stop == std::string_view::npos) return {};
    const std::string_view line = text.substr(0, stop);
    if (!line.starts_with('#') && !trimmed(line).empty()) return line;
    text.remove_prefix(stop + 1);
  }
  return {};
}

}  // namespace

// Head first (in the constructor), then rows, window by window of whole lines.
struct BlockReader::State {
  State(ByteSource bytes, const ReadOptions& read_options, std::size_t rows_in_block)
      : source(std::move(bytes)), options(read_options), block_rows(std::max<std::size_t>(rows_in_block, 1)) {
    read_head();
  }

  bool next(series::Recording& block) {
    prepare(block);
    std::size_t wanted = block_rows;
    while (wanted > 0) {
      const char* const lines_end = whole_lines_end();
      if (source.begin() == lines_end) {
        if (more_lines()) continue;
        break;
      }
      const std::size_t before = rows->rows();
      reserve_for_file(block);
      source.consume_to(
          rows->parse(source.begin(), lines_end, wanted, block.columns, metadata, cut_off && at_end));
      wanted -= rows->rows() - before;
    }
    if (at_end && rows->rows() == 0) {
      throw Error(ErrorKind::kBadInput, "no_rows",
                  "the file has a header but no rows; record again, or check the export",
                  {source.name(), rows->next_line(), 1});
    }
    block.metadata = metadata.values();
    if (block.rows() > 0) return true;
    if (options.hash && sha256.empty()) sha256 = source.sha256();
    block.sha256 = sha256;
    return false;
  }

  // One more piece of bytes; at the end of the file, what is left of the last line. False when nothing is left.
  bool more_lines() {
    if (at_end) return false;
    if (source.window().size() > kLongestLine)
      refuse_long_line(source.name(), rows ? rows->next_line() : line);
    last_line_end.reset();  // fill() moves the window
    if (source.fill()) return true;
    at_end = true;
    const std::string_view window = source.window();
    if (window.empty() || window.ends_with('\n')) return false;
    if (header_read && metadata.has("log", "append-only") && !metadata.values().contains("closed")) {
      // An append-only log that was not closed: its writer was killed, and the line that it was writing is torn.
      const long first = rows ? rows->next_line() : line;
      metadata.set("torn_line", std::to_string(first + std::count(window.begin(), window.end(), '\n')));
      source.drop_behind(window.substr(0, window.rfind('\n') + 1));  // npos + 1 is 0
      return false;
    }
    cut_off = true;
    source.terminate();
    return true;
  }

  // One past the last line feed in the window (the window's begin if it has none).
  const char* whole_lines_end() {
    if (!last_line_end) {
      const std::string_view window = source.window();
      const std::size_t feed = window.rfind('\n');
      last_line_end = feed == std::string_view::npos ? source.begin() : source.begin() + feed + 1;
    }
    return *last_line_end;
  }

  void read_head() {
    if (!more_lines()) {
      throw Error(ErrorKind::kBadInput, "file_empty", "the file is empty; record again, or check the export",
                  {source.name(), 0, 0});
    }
    skip_byte_order_mark();
    for (;;) {
      if (source.begin() == whole_lines_end()) {
        if (more_lines()) continue;
        throw Error(
            ErrorKind::kBadInput, "header_missing",
            "the file has no header; put a line such as `time [s],angle [deg]` in front of the numbers",
            {source.name(), line, 1});
      }
      const char* const feed = std::find(source.begin(), whole_lines_end(), '\n');
      const std::string_view text =
          without_carriage_return({source.begin(), static_cast<std::size_t>(feed - source.begin())});
      if (text.size() > kLongestLine) refuse_long_line(source.name(), line);
      if (text.starts_with('#')) {
        metadata.add_line(text, {source.name(), line, 1});
      } else if (!trimmed(text).empty()) {
        read_header(std::string(text), static_cast<std::size_t>(feed + 1 - source.begin()));
        return;
      }
      source.consume_to(feed + 1);
      ++line;
    }
  }

  // `length` bytes of the window are the header's line; the first row behind it helps to find the separator.
  void read_header(const std::string& text, std::size_t length) {
    header_read = true;
    const auto rest = [&] { return source.window().substr(length); };
    while (first_row(rest()).empty() && !at_end && rest().size() < kLongestLine) {
      if (!more_lines()) break;
    }
    Header header = parse_header(text, first_row(rest()), options, {source.name(), line, 1});
    source.consume_to(source.begin() + length);
    rows.emplace(std::move(header), source.name(), line + 1);
  }

  void skip_byte_order_mark() {
    while (source.window().size() < 3 && !at_end) {
      last_line_end.reset();
      if (!source.fill()) break;
    }
    const std::string_view window = source.window();
    if (window.starts_with("\xEF\xBB\xBF")) {
      source.consume_to(source.begin() + 3);
      last_line_end.reset();
    } else if (window.starts_with("\xFF\xFE") || window.starts_with("\xFE\xFF")) {
      throw Error(ErrorKind::kBadInput, "not_utf8",
                  "the file is UTF-16; save it as UTF-8, e.g. with `iconv -f utf-16 -t utf-8`",
                  {source.name(), 1, 1});
    }
  }

  void prepare(series::Recording& block) const {
    const std::vector<series::Column> fresh = rows->empty_columns();
    const bool same =
        std::equal(fresh.begin(), fresh.end(), block.columns.begin(), block.columns.end(),
                   [](const auto& a, const auto& b) { return a.name == b.name && a.unit == b.unit; });
    if (!same) block.columns = fresh;
    for (series::Column& column : block.columns) column.values.clear();
    block.source = source.name();
    block.sha256.clear();
  }

  // Room for the rows to come, guessed from the bytes per row so far, so that columns hardly ever grow by copying.
  void reserve_for_file(series::Recording& block) const {
    const std::uint64_t parsed = source.bytes_read() - source.window().size();
    if (rows->rows() == 0 || source.size() <= parsed) return;
    const double rows_per_byte = static_cast<double>(rows->rows()) / static_cast<double>(parsed);
    const auto rows_in = [&](double bytes) { return static_cast<std::size_t>(bytes * rows_per_byte); };
    const double to_come = static_cast<double>(source.size() - parsed);
    const std::size_t whole = std::min(block_rows, block.rows() + rows_in(1.01 * to_come) + 64);
    const std::size_t soon =
        std::min(whole, block.rows() + 2 * rows_in(static_cast<double>(source.window().size())));
    for (series::Column& column : block.columns) {
      if (column.values.capacity() < soon) column.values.reserve(whole);
    }
  }

  ByteSource source;
  ReadOptions options;
  std::size_t block_rows;
  Metadata metadata;
  std::optional<RowParser> rows;  ///< once the header is read
  std::optional<const char*> last_line_end;
  long line = 1;  ///< of the head
  bool header_read = false;
  bool at_end = false;   ///< the source has nothing more
  bool cut_off = false;  ///< the last line has no line feed
  std::string sha256;
};

BlockReader::BlockReader(const std::filesystem::path& path, const ReadOptions& options,
                         std::size_t block_rows)
    : state_(std::make_unique<State>(ByteSource::open(path, options.hash), options, block_rows)) {}
BlockReader::BlockReader(std::unique_ptr<State> state) : state_(std::move(state)) {}
BlockReader::~BlockReader() = default;
BlockReader::BlockReader(BlockReader&&) noexcept = default;
BlockReader& BlockReader::operator=(BlockReader&&) noexcept = default;

BlockReader BlockReader::of_bytes(std::string_view bytes, std::string name, const ReadOptions& options,
                                  std::size_t block_rows, std::size_t piece) {
  return BlockReader(std::make_unique<State>(
      ByteSource::of_memory(bytes, std::move(name), options.hash, piece), options, block_rows));
}

bool BlockReader::next(series::Recording& block) {
  return state_->next(block);
}

namespace {

series::Recording read_all(BlockReader reader) {
  series::Recording recording;
  reader.next(recording);
  series::Recording end;
  reader.next(end);  // no rows left: brings the hash and what stood behind the rows
  recording.metadata = std::move(end.metadata);
  recording.sha256 = std::move(end.sha256);
  return recording;
}

constexpr std::size_t kAllRows = static_cast<std::size_t>(-1);

}  // namespace

series::Recording read_recording(const std::filesystem::path& path, const ReadOptions& options) {
  return read_all(BlockReader(path, options, kAllRows));
}

series::Recording parse_recording(std::string_view bytes, const std::string& file_name,
                                  const ReadOptions& options) {
  return read_all(BlockReader::of_bytes(bytes, file_name, options, kAllRows));
}

}  // namespace isac::record
