#include "isac/record/csv_metadata.hpp"

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "isac/record/csv_text.hpp"

namespace isac::record {
namespace {

constexpr std::size_t kMostBytes = std::size_t{1} << 20U;
constexpr std::string_view kExperiments[] = {
    "constant-pressure", "constant-angle", "free", "pcu-step", "pose", "closed-loop", "calibration"};

// Lower case, with '_' and ' ' as '-': what people type when they mean one of the list.
std::string normalised(std::string_view text) {
  std::string out(text);
  for (char& c : out) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    if (c == '_' || c == ' ') c = '-';
  }
  return out;
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({change, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

// The known experiment that `text` misspells, or nothing.
std::string_view misspelt(std::string_view text) {
  if (text.size() > 40) return {};
  const std::string word = normalised(text);
  for (std::string_view known : kExperiments) {
    if (text == known) return {};
  }
  for (std::string_view known : kExperiments) {
    if (word == known || (known.size() >= 8 && edit_distance(word, known) <= 2)) return known;
  }
  return {};
}

// Reads exactly `digits` digits at text[i] as a number in [low, high].
bool number(std::string_view text, std::size_t& i, int digits, int low, int high) noexcept {
  int value = 0;
  for (int k = 0; k < digits; ++k, ++i) {
    if (i >= text.size() || text[i] < '0' || text[i] > '9') return false;
    value = 10 * value + (text[i] - '0');
  }
  return value >= low && value <= high;
}

bool skip(std::string_view text, std::size_t& i, char wanted) noexcept {
  if (i >= text.size() || text[i] != wanted) return false;
  ++i;
  return true;
}

bool zone(std::string_view text, std::size_t& i) noexcept {
  if (i == text.size()) return true;
  if (skip(text, i, 'Z')) return i == text.size();
  if (!skip(text, i, '+') && !skip(text, i, '-')) return false;
  if (!number(text, i, 2, 0, 23)) return false;
  if (i == text.size()) return true;
  skip(text, i, ':');
  return number(text, i, 2, 0, 59) && i == text.size();
}

}  // namespace

bool is_iso8601(std::string_view text) noexcept {
  std::size_t i = 0;
  if (!number(text, i, 4, 0, 9999) || !skip(text, i, '-') || !number(text, i, 2, 1, 12) ||
      !skip(text, i, '-') || !number(text, i, 2, 1, 31)) {
    return false;
  }
  if (i == text.size()) return true;
  if (!skip(text, i, 'T') && !skip(text, i, ' ')) return false;
  if (!number(text, i, 2, 0, 23) || !skip(text, i, ':') || !number(text, i, 2, 0, 59)) return false;
  if (skip(text, i, ':')) {
    if (!number(text, i, 2, 0, 60)) return false;  // 60: a leap second
    if (skip(text, i, '.')) {
      const std::size_t begin = i;
      while (i < text.size() && text[i] >= '0' && text[i] <= '9') ++i;
      if (i == begin) return false;
    }
  }
  return zone(text, i);
}

void check_text(std::string_view text, Place place) {
  const auto refuse_at = [&](std::size_t at, const char* code, const std::string& sentence) {
    place.column = std::max(place.column, 1L) - 1 + character_column(text, at);
    throw Error(ErrorKind::kBadInput, code, sentence, place);
  };
  for (std::size_t at = 0; at < text.size(); ++at) {
    const auto byte = static_cast<std::uint8_t>(text[at]);
    if (byte == '\r' && at + 1 < text.size()) {
      refuse_at(at, "line_ends_cr",
                "a carriage return stands alone; save the file with line feeds, e.g. with `tr '\\r' '\\n'`");
    }
    if ((byte < 0x20 && byte != '\t' && byte != '\r') || byte == 0x7F) {
      refuse_at(at, "file_binary",
                "holds the control byte " + shown(text.substr(at, 1)) +
                    ", so this is no text file; export the recording as CSV");
    }
  }
  const std::size_t at = find_invalid_utf8(text);
  if (at != std::string_view::npos) {
    refuse_at(at, "not_utf8",
              "the byte " + shown(text.substr(at, 1)) +
                  " is not UTF-8; save the file as UTF-8, e.g. with `iconv -f latin1 -t utf-8`");
  }
}

void Metadata::add_line(std::string_view line, const Place& place) {
  check_text(line, place);
  std::string_view rest = line;
  while (!rest.empty() && rest.front() == '#') rest.remove_prefix(1);
  const std::size_t colon = rest.find(':');
  if (colon == std::string_view::npos) return;
  const std::string_view key = trimmed(rest.substr(0, colon));
  const std::string_view value = trimmed(rest.substr(colon + 1));
  if (key.empty()) return;

  bytes_ += line.size();
  if (bytes_ > kMostBytes) {
    throw Error(
        ErrorKind::kBadInput, "metadata_too_long",
        "the lines that begin with # hold more than 1 MB; keep notes of that length in a file of their own",
        place);
  }
  const long value_column = character_column(line, static_cast<std::size_t>(value.data() - line.data()));
  if (key == "started" && !is_iso8601(value)) {
    throw Error(
        ErrorKind::kBadInput, "started_not_iso8601",
        "started is " + shown(value) + ", which is no ISO 8601 time; write it like 2003-05-01T14:30:00Z",
        {place.file, place.line, value_column});
  }
  if (key == "experiment") {
    if (const std::string_view meant = misspelt(value); !meant.empty()) {
      throw Error(
          ErrorKind::kBadInput, "experiment_misspelt",
          "experiment " + shown(value) + " is not known; write " + std::string(meant) +
              " (known: constant-pressure, constant-angle, free, pcu-step, pose, closed-loop, calibration)",
          {place.file, place.line, value_column});
    }
  }
  auto [entry, fresh] = values_.try_emplace(std::string(key), value);
  if (!fresh) entry->second.append("; ").append(value);
}

bool Metadata::has(const std::string& key, std::string_view value) const {
  const auto found = values_.find(key);
  return found != values_.end() && found->second == value;
}

}  // namespace isac::record
