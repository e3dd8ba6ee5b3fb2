/// @file
/// Writes JSON, one value after another; numbers with 17 digits, NaN and infinity as null.
#pragma once

#include <charconv>
#include <cmath>
#include <string>
#include <string_view>

namespace blind {

class JsonWriter {
 public:
  JsonWriter& open(char bracket) {
    begin();
    text_ += bracket;
    first_ = true;
    return *this;
  }
  JsonWriter& close(char bracket) {
    text_ += bracket;
    first_ = false;
    return *this;
  }
  JsonWriter& key(std::string_view name) {
    begin();
    quote(name);
    text_ += ':';
    after_key_ = true;
    return *this;
  }
  JsonWriter& value(double number) {
    begin();
    if (!std::isfinite(number)) {
      text_ += "null";
      return *this;
    }
    char digits[32];
    const auto end = std::to_chars(digits, digits + sizeof digits, number);
    text_.append(digits, end.ptr);
    return *this;
  }
  JsonWriter& value(std::string_view word) {
    begin();
    quote(word);
    return *this;
  }
  JsonWriter& value(const char* word) { return value(std::string_view(word)); }
  JsonWriter& value(bool yes) {
    begin();
    text_ += yes ? "true" : "false";
    return *this;
  }
  /// Text that is JSON already.
  JsonWriter& raw(std::string_view json) {
    begin();
    text_ += json;
    return *this;
  }
  JsonWriter& null() {
    begin();
    text_ += "null";
    return *this;
  }
  template <typename T>
  JsonWriter& field(std::string_view name, const T& content) {
    return key(name).value(content);
  }
  template <typename Words>
  JsonWriter& list(std::string_view name, const Words& words) {
    key(name).open('[');
    for (const auto& word : words) value(word);
    return close(']');
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  void begin() {
    if (!after_key_ && !first_) text_ += ',';
    first_ = after_key_ = false;
  }
  void quote(std::string_view word) {
    text_ += '"';
    constexpr char kHex[] = "0123456789abcdef";
    for (const char c : word) {
      const auto code = static_cast<unsigned char>(c);
      if (code < 0x20) {
        text_ += "\\u00";
        text_ += kHex[code >> 4];
        text_ += kHex[code & 15];
        continue;
      }
      if (c == '"' || c == '\\') text_ += '\\';
      text_ += c;
    }
    text_ += '"';
  }

  std::string text_;
  bool first_ = true, after_key_ = false;
};

}  // namespace blind
