#include "isac/record/toml_document.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

#include "isac/record/toml_quantity.hpp"

namespace isac::record {
namespace {

constexpr std::uintmax_t kMaxBytes = 16u << 20;
constexpr int kMaxDots = 8, kMaxBrackets = 32;

Place place_of(const toml::source_region& region, const std::string& file) {
  return {file, static_cast<long>(region.begin.line), static_cast<long>(region.begin.column)};
}

constexpr std::size_t kLongestWord = 60, kLongestSentence = 600;

/// One line of bounded length, whatever the file's keys and values hold.
std::string one_line(std::string text, std::size_t longest) {
  for (char& letter : text) {
    if (static_cast<unsigned char>(letter) < 0x20 || letter == 0x7F) letter = ' ';
  }
  if (text.size() <= longest) return text;
  std::size_t end = longest;  // not in the middle of a UTF-8 letter
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0u) == 0x80u) --end;
  return text.substr(0, end) + "…";
}

[[noreturn]] void throw_bad_input(std::string code, std::string text, Place place) {
  throw Error(ErrorKind::kBadInput, std::move(code), one_line(std::move(text), kLongestSentence),
              std::move(place));
}

/// Skips a TOML string that begins at `at`; returns the position behind it.
std::size_t skip_string(const std::string& text, std::size_t at, long& line) {
  const char quote = text[at];
  const bool multi_line = text.compare(at, 3, std::string(3, quote)) == 0;
  at += multi_line ? 3 : 1;
  while (at < text.size()) {
    if (text[at] == '\\' && quote == '"') {
      at += 2;
    } else if (multi_line && text.compare(at, 3, std::string(3, quote)) == 0) {
      return at + 3;
    } else if (!multi_line && (text[at] == quote || text[at] == '\n')) {
      return at + (text[at] == quote ? 1 : 0);
    } else {
      if (text[at] == '\n') ++line;
      ++at;
    }
  }
  return text.size();
}

/// Refuses nesting that no configuration has, before a recursive parser follows it.
void refuse_deep_nesting(const std::string& text, const std::string& file) {
  int dots = 0, brackets = 0;
  long line = 1;
  for (std::size_t at = 0; at < text.size();) {
    const char letter = text[at];
    if (letter == '"' || letter == '\'') {
      at = skip_string(text, at, line);
      continue;
    }
    if (letter == '#') {
      at = std::min(text.find('\n', at), text.size());
      continue;
    }
    if (letter == '\n') ++line;
    if (letter == '.') ++dots;
    if (letter == '\n' || letter == '=' || letter == ',' || letter == '[' || letter == '{') dots = 0;
    if (letter == '[' || letter == '{') ++brackets;
    if (letter == ']' || letter == '}') brackets = std::max(0, brackets - 1);
    if (dots > kMaxDots || brackets > kMaxBrackets) {
      throw_bad_input("nested_too_deeply",
                      "keys or brackets are nested too deeply to be meant; keep to " +
                          std::to_string(kMaxDots) + " names in a key and " + std::to_string(kMaxBrackets) +
                          " open brackets",
                      {file, line, 0});
    }
    ++at;
  }
}

std::string join_quoted(std::initializer_list<std::string_view> words) {
  std::string out;
  for (const std::string_view word : words) out += (out.empty() ? "'" : ", '") + std::string(word) + "'";
  return out;
}

}  // namespace

std::string read_text_file(const std::filesystem::path& path) {
  const auto fail = [&path](const std::string& why) {
    throw Error(ErrorKind::kBadInput, "file_unreadable", "cannot be read: " + why, {path.string(), 0, 0});
  };
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) fail("it is a folder; name a file in it");
  std::ifstream stream(path, std::ios::binary);
  if (!stream) fail(std::string(std::strerror(errno)) + "; check the name and the permissions");
  std::string text;
  std::array<char, 65536> block{};
  while (stream.read(block.data(), block.size()) || stream.gcount() > 0) {
    text.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > kMaxBytes) fail("it is larger than 16 MiB, which no configuration is; check the name");
  }
  if (stream.bad()) fail(std::strerror(errno));
  return text;
}

toml::table parse_toml(const std::string& text, const std::string& file) {
  refuse_deep_nesting(text, file);
  try {
    return toml::parse(std::string_view(text), std::string_view(file));
  } catch (const toml::parse_error& error) {
    throw_bad_input(
        "toml_syntax",
        "is not valid TOML: " + std::string(error.description()) + "; mend this line, or write the file anew",
        place_of(error.source(), file));
  }
}

void fail_at(const toml::node& node, const std::string& file, std::string code, std::string text) {
  throw_bad_input(std::move(code), std::move(text), place_of(node.source(), file));
}

std::string shown(const toml::node& node) {
  if (const auto* value = node.as_string()) return toml_string(one_line(value->get(), kLongestWord));
  if (const auto* value = node.as_integer()) return std::to_string(value->get());
  if (const auto* value = node.as_floating_point()) return exact_number(value->get());
  if (const auto* value = node.as_boolean()) return value->get() ? "true" : "false";
  if (node.is_array()) return "an array";
  return node.is_table() ? "a table" : "a date";
}

TomlSection::TomlSection(const toml::table& table, std::string name, const std::string& file,
                         std::initializer_list<std::string_view> known)
    : table_(&table), name_(std::move(name)), file_(&file) {
  if (known.size() == 0) return;
  for (const auto& [key, node] : table) {
    if (std::ranges::find(known, key.str()) != known.end()) continue;
    const std::string nearest = nearest_word(key.str(), known);
    throw_bad_input(
        "unknown_key",
        "'" + one_line(std::string(key.str()), kLongestWord) + "' is not a key of " + where() + "; " +
            (nearest.empty() ? "it knows " + join_quoted(known) : "did you mean '" + nearest + "'?"),
        place_of(key.source(), file));
  }
}

std::string TomlSection::where() const {
  return name_.empty() ? "the top of the file" : "[" + name_ + "]";
}

const toml::node* TomlSection::find(std::string_view key) const {
  return table_->get(key);
}

bool TomlSection::has(std::string_view key) const {
  return find(key) != nullptr;
}

void TomlSection::fail(std::string_view key, std::string code, std::string text) const {
  const toml::node* node = find(key);
  const toml::node& where = node != nullptr ? *node : *table_;
  fail_at(where, *file_, std::move(code), std::move(text));
}

void TomlSection::require_format(std::string_view format) const {
  const std::string wanted = "'format = " + toml_string(format) + "'";
  const auto found = text("format");
  if (!found) fail("format", "format_missing", "does not say its format; begin the file with " + wanted);
  if (*found != format) {
    fail("format", "format_wrong",
         "is of format " + toml_string(*found) + ", and " + wanted + " is needed here; give another file");
  }
}

std::optional<std::string> TomlSection::text(std::string_view key) const {
  const toml::node* node = find(key);
  if (node == nullptr) return std::nullopt;
  if (const auto* value = node->as_string()) return value->get();
  fail(key, "type_wrong",
       "'" + std::string(key) + "' is " + shown(*node) + "; write a text in quotation marks");
}

std::optional<double> TomlSection::quantity(std::string_view key, const Dimension& dimension) const {
  const toml::node* node = find(key);
  if (node == nullptr) return std::nullopt;
  const std::string start = "'" + std::string(key) + "' is ";
  const std::string example = "\"38 " + std::string(usual_unit(dimension)) + "\"";
  if (node->is_number()) {
    fail(key, "unit_missing",
         start + "the bare number " + shown(*node) + "; write it with its unit in quotation marks, like \"" +
             shown(*node) + " " + std::string(usual_unit(dimension)) + "\"");
  }
  const auto* value = node->as_string();
  if (value == nullptr)
    fail(key, "type_wrong", start + shown(*node) + "; write a number with its unit, like " + example);
  const Quantity quantity = parse_quantity(value->get());
  const std::string do_units =
      "; " + std::string(name_of(dimension)) + " is needed, in " + std::string(units_of(dimension));
  switch (quantity.problem) {
    case Quantity::Problem::kNone:
      break;
    case Quantity::Problem::kNoNumber:
      fail(key, "number_missing",
           start + shown(*node) + ", which does not begin with a number; write it like " + example);
    case Quantity::Problem::kNotFinite:
      fail(key, "number_not_finite", start + shown(*node) + ", which is not finite" + do_units);
    case Quantity::Problem::kNoUnit:
      fail(key, "unit_missing", start + shown(*node) + " without a unit" + do_units);
    case Quantity::Problem::kUnknownUnit:
      fail(key, "unit_unknown",
           start + shown(*node) + ", and '" + quantity.unit_text + "' is not a known unit" + do_units);
  }
  if (quantity.unit.dimension != dimension) {
    fail(key, "dimension_wrong",
         start + shown(*node) + ", " + std::string(name_of(quantity.unit.dimension)) + do_units);
  }
  return quantity.value;
}

std::optional<double> TomlSection::number(std::string_view key) const {
  const toml::node* node = find(key);
  if (node == nullptr) return std::nullopt;
  if (const auto* value = node->as_floating_point()) return value->get();
  if (const auto* value = node->as_integer()) return static_cast<double>(value->get());
  fail(key, "type_wrong", "'" + std::string(key) + "' is " + shown(*node) + "; write a plain number");
}

std::optional<bool> TomlSection::boolean(std::string_view key) const {
  const toml::node* node = find(key);
  if (node == nullptr) return std::nullopt;
  if (const auto* value = node->as_boolean()) return value->get();
  fail(key, "type_wrong", "'" + std::string(key) + "' is " + shown(*node) + "; write true or false");
}

std::vector<std::string> TomlSection::texts(std::string_view key) const {
  std::vector<std::string> out;
  const toml::node* node = find(key);
  if (node == nullptr) return out;
  const std::string mend = "; write texts in square brackets, like [\"one\", \"two\"]";
  const auto* array = node->as_array();
  if (array == nullptr) fail(key, "type_wrong", "'" + std::string(key) + "' is " + shown(*node) + mend);
  for (const toml::node& entry : *array) {
    const auto* value = entry.as_string();
    if (value == nullptr)
      fail_at(entry, *file_, "type_wrong", "'" + std::string(key) + "' holds " + shown(entry) + mend);
    out.push_back(value->get());
  }
  return out;
}

const toml::table* TomlSection::table(std::string_view key) const {
  const toml::node* node = find(key);
  if (node == nullptr) return nullptr;
  if (const auto* value = node->as_table()) return value;
  fail(
      key, "type_wrong",
      "'" + std::string(key) + "' is " + shown(*node) + "; write it as a section [" + std::string(key) + "]");
}

std::vector<const toml::table*> TomlSection::tables(std::string_view key) const {
  std::vector<const toml::table*> out;
  const toml::node* node = find(key);
  if (node == nullptr) return out;
  const std::string mend = "; write it as sections [[" + std::string(key) + "]]";
  if (const auto* single = node->as_table()) return {single};
  const auto* array = node->as_array();
  if (array == nullptr) fail(key, "type_wrong", "'" + std::string(key) + "' is " + shown(*node) + mend);
  for (const toml::node& entry : *array) {
    const auto* table = entry.as_table();
    if (table == nullptr)
      fail_at(entry, *file_, "type_wrong", "'" + std::string(key) + "' holds " + shown(entry) + mend);
    out.push_back(table);
  }
  return out;
}

std::string toml_string(std::string_view text) {
  constexpr std::string_view kHex = "0123456789ABCDEF";
  std::string out = "\"";
  for (const char letter : text) {
    const auto byte = static_cast<unsigned char>(letter);
    if (letter == '"' || letter == '\\') {
      out += '\\';
      out += letter;
    } else if (byte < 0x20 || byte == 0x7F) {
      out += "\\u00";
      out += kHex[byte >> 4];
      out += kHex[byte & 15];
    } else {
      out += letter;
    }
  }
  return out + "\"";
}

std::string key_text(std::string_view key) {
  constexpr std::string_view kBare = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-";
  if (!key.empty() && key.find_first_not_of(kBare) == std::string_view::npos) return std::string(key);
  return toml_string(key);
}

}  // namespace isac::record
