#include "isac/report/text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace isac::report {
namespace {

std::string true_minus(std::string text) {
  if (!text.empty() && text.front() == '-') text.replace(0, 1, "−");
  return text;
}

bool is_zero_text(const std::string& text) {
  return text.find_first_of("123456789") == std::string::npos;
}

std::string fixed(double value, int decimals) {
  if (decimals < 0) {
    const double grain = std::pow(10.0, -decimals);
    return true_minus(fmt::format("{:.0f}", std::round(value / grain) * grain));
  }
  std::string text = fmt::format("{:.{}f}", value, decimals);
  if (text.front() == '-' && is_zero_text(text)) text.erase(0, 1);
  return true_minus(text);
}

std::string raised(int exponent) {
  constexpr std::array kDigit = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string out = exponent < 0 ? "⁻" : "";
  for (const char c : fmt::format("{}", std::abs(exponent))) out += kDigit[static_cast<std::size_t>(c - '0')];
  return out;
}

std::string scientific(double value, int digits) {
  const std::string text = fmt::format("{:.{}e}", value, std::max(0, digits - 1));
  const auto e = text.find('e');
  return true_minus(text.substr(0, e)) + " · 10" + raised(std::stoi(text.substr(e + 1)));
}

int magnitude(double value) {
  return static_cast<int>(std::floor(std::log10(std::abs(value))));
}

/// Decimals that show two digits of the error; the error is rounded first, so that 0.0996 counts as 0.10.
int decimals_for(double std_error) {
  const int first = magnitude(std_error);
  const double grain = std::pow(10.0, first - 1);
  const int rounded = magnitude(std::round(std_error / grain) * grain * (1 + 1e-12));
  return 1 - rounded;
}

bool usable_error(double std_error) {
  return std::isfinite(std_error) && std_error > 0;
}

/// Bytes of the valid UTF-8 sequence at `at`, 0 when it is not valid.
std::size_t sequence_length(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t lead = byte(at);
  std::size_t length = 0;
  if (lead < 0x80) return 1;
  if (lead >= 0xC2 && lead <= 0xDF) length = 2;
  if (lead >= 0xE0 && lead <= 0xEF) length = 3;
  if (lead >= 0xF0 && lead <= 0xF4) length = 4;
  if (length == 0 || at + length > text.size()) return 0;
  for (std::size_t i = 1; i < length; ++i)
    if ((byte(at + i) & 0xC0U) != 0x80) return 0;
  const std::uint8_t second = byte(at + 1);
  if ((lead == 0xE0 && second < 0xA0) || (lead == 0xED && second > 0x9F) || (lead == 0xF0 && second < 0x90) ||
      (lead == 0xF4 && second > 0x8F))
    return 0;
  return length;
}

}  // namespace

std::string number(double value, int digits) {
  if (std::isnan(value)) return "–";
  if (std::isinf(value)) return value > 0 ? "∞" : "−∞";
  if (value == 0) return "0";
  const int size = magnitude(value);
  if (size < -4 || size >= 7) return scientific(value, digits);
  return fixed(value, std::max(0, digits - 1 - size));
}

std::string fixed_decimals(double value, int decimals) {
  return std::isfinite(value) ? fixed(value, decimals) : number(value);
}

std::string whole(double value) {
  if (!std::isfinite(value)) return "–";
  std::string text = fmt::format("{:.0f}", std::abs(value));
  for (std::size_t at = text.size(); at > 3; at -= 3) text.insert(at - 3, "\u202F");
  return value < 0 ? "−" + text : text;
}

std::string probability(double p) {
  if (std::isnan(p)) return "–";
  if (p < 0.001) return "< 0.001";
  return fixed(p, p < 0.1 ? 3 : 2);
}

Rounded with_error(double value, double std_error) {
  if (!usable_error(std_error) || !std::isfinite(value)) return {number(value), "–"};
  const int decimals = decimals_for(std_error);
  if (decimals > 8 || decimals < -6) return {scientific(value, 4), scientific(std_error, 2)};
  return {fixed(value, decimals), fixed(std_error, decimals)};
}

std::string to_error_digit(double value, double std_error) {
  if (!usable_error(std_error) || !std::isfinite(value)) return number(value);
  return with_error(value, std_error).value;
}

std::string pretty_unit(std::string_view unit) {
  if (unit == "-" || unit == "1") return {};
  constexpr std::array kDigit = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
  std::string out;
  bool after_letter = false;
  for (const char c : unit) {
    if (c == '^') continue;
    if (after_letter && c >= '0' && c <= '9') {
      out += kDigit[static_cast<std::size_t>(c - '0')];
      continue;
    }
    after_letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    if (c == ' ' || c == '*') {
      out += "\u00A0";
    } else {
      out += c;
    }
  }
  return clean_utf8(out);
}

std::string pretty_sentence(std::string_view sentence) {
  constexpr std::array kUnits = {"cm2", "rad2", "rad3", "rad4", "s2", "s3", "kg m2"};
  const auto is_word = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  };
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  std::string out;
  for (std::size_t i = 0; i < sentence.size();) {
    const std::string_view rest = sentence.substr(i);
    const bool begins = i == 0 || !is_word(sentence[i - 1]);
    const bool stands_free = i == 0 || sentence[i - 1] == ' ' || sentence[i - 1] == '(';
    if (stands_free && rest.size() > 1 && rest[0] == '-' && is_digit(rest[1])) {
      out += "−";
      ++i;
      continue;
    }
    const auto unit = std::find_if(kUnits.begin(), kUnits.end(), [&](std::string_view u) {
      return begins && rest.starts_with(u) && (rest.size() == u.size() || !is_word(rest[u.size()]));
    });
    if (unit == kUnits.end()) {
      out += sentence[i++];
      continue;
    }
    const std::string_view found = *unit;
    out += found.substr(0, found.size() - 1);
    out += pretty_unit(std::string("s") + found.back()).substr(1);
    i += found.size();
  }
  return out;
}

std::string clean_utf8(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t i = 0; i < text.size();) {
    const std::size_t length = sequence_length(text, i);
    if (length == 0) {
      out += "\uFFFD";
      ++i;
      continue;
    }
    const auto lead = static_cast<std::uint8_t>(text[i]);
    if (length == 1 && (lead < 0x20 || lead == 0x7F)) {
      out += ' ';
    } else {
      out.append(text, i, length);
    }
    i += length;
  }
  return out;
}

std::string escape(std::string_view text) {
  std::string out;
  for (const char c : clean_utf8(text)) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string file_name(std::string_view path) {
  const auto slash = path.find_last_of('/');
  return std::string(slash == std::string_view::npos ? path : path.substr(slash + 1));
}

std::size_t glyphs(std::string_view text) noexcept {
  std::size_t n = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<std::uint8_t>(text[i]);
    if ((c & 0xC0U) == 0x80) continue;
    if (c == 0xCC) continue;  // combining diacritical marks begin with this byte
    ++n;
  }
  return n;
}

}  // namespace isac::report
