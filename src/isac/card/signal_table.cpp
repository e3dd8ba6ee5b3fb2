#include "isac/card/signal_table.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <set>
#include <string_view>
#include <tuple>
#include <utility>

#include "isac/card/card.hpp"
#include "isac/core/error.hpp"
#include "isac/record/data_tables.hpp"

namespace isac::card {
namespace {

using Kind = SignalLine::Kind;

constexpr struct {
  Kind kind;
  const char* prefix;
  int most;
} kKinds[] = {
    {Kind::kEncoder, "enc", kEncoders}, {Kind::kInput, "ai", kInputs}, {Kind::kOutput, "ao", kOutputs}};

class RowReader {
 public:
  RowReader(const record::DataTable& data, std::size_t row) : data_(data), row_(row) {}

  [[nodiscard]] SignalLine line() const {
    static const std::set<std::string> known = {"signal", "device",    "driver", "subdevice", "channel",
                                                "range",  "reference", "vented", "setup"};
    for (const auto& [name, cell] : data_.rows[row_])
      if (!known.contains(name))
        refuse("column_unknown", "the column '" + name +
                                     "' is unknown; write signal, device, driver, subdevice, "
                                     "channel, range, reference, vented or setup");
    SignalLine line;
    read_signal(line);
    line.device = data_.text(row_, "device");
    if (line.device.empty()) refuse("value_missing", "has no device; write one like \"/dev/comedi0\"");
    line.driver = data_.text(row_, "driver");
    line.subdevice = whole("subdevice", true);
    line.channel = whole("channel", true);
    line.vented = whole("vented", false);
    if (line.vented != 0 && line.kind != Kind::kOutput)
      refuse("value_out_of_place", "only an output can be vented");
    read_range(line);
    line.reference =
        one_of<SignalLine::Reference>("reference", {{"", SignalLine::Reference::kGround},
                                                    {"ground", SignalLine::Reference::kGround},
                                                    {"common", SignalLine::Reference::kCommon},
                                                    {"differential", SignalLine::Reference::kDifferential},
                                                    {"other", SignalLine::Reference::kOther}});
    line.setup = one_of<SignalLine::Setup>("setup", {{"", SignalLine::Setup::kNone},
                                                     {"preload", SignalLine::Setup::kPreload},
                                                     {"quadrature x4", SignalLine::Setup::kQuadratureX4}});
    if (line.setup != SignalLine::Setup::kNone && line.kind != Kind::kEncoder)
      refuse("value_out_of_place", "only an encoder needs a setup");
    return line;
  }

 private:
  [[noreturn]] void refuse(const std::string& code, const std::string& text) const {
    const std::string signal =
        data_.rows[row_].contains("signal") ? " (" + data_.text(row_, "signal") + ")" : "";
    throw Error(ErrorKind::kBadInput, code, "row " + std::to_string(row_ + 1) + signal + ": " + text,
                {data_.file, 0, 0});
  }

  void read_signal(SignalLine& line) const {
    line.signal = data_.text(row_, "signal");
    if (line.signal == "heartbeat") {
      line.kind = Kind::kHeartbeat;
      return;
    }
    for (const auto& kind : kKinds) {
      const std::string_view prefix = kind.prefix;
      if (!line.signal.starts_with(prefix)) continue;
      const char* end = line.signal.data() + line.signal.size();
      const auto [rest, error] = std::from_chars(line.signal.data() + prefix.size(), end, line.index);
      if (error != std::errc() || rest != end || line.index < 0 || line.index >= kind.most) continue;
      line.kind = kind.kind;
      return;
    }
    refuse("signal_unknown", "'" + line.signal +
                                 "' is no signal of a card; write enc0 to enc5, ai0 to ai7, ao0 to ao11 or "
                                 "heartbeat");
  }

  [[nodiscard]] unsigned whole(const char* column, bool needed) const {
    const double value = data_.number(row_, column);
    if (std::isnan(value) && !needed) return 0;
    if (!(value >= 0.0) || value > 4294967295.0 || value != std::floor(value))
      refuse("value_out_of_range", std::string("'") + column + "' must be a whole number from 0 on");
    return static_cast<unsigned>(value);
  }

  void read_range(SignalLine& line) const {
    line.range_text = data_.text(row_, "range");
    if (line.kind == Kind::kEncoder || line.kind == Kind::kHeartbeat) {
      if (!line.range_text.empty()) refuse("value_out_of_place", "an encoder and a heartbeat have no range");
      return;
    }
    const std::string& text = line.range_text;
    const std::size_t dots = text.find("..");
    const char* end = text.data() + text.size();
    if (dots != std::string::npos) {
      const auto low = std::from_chars(text.data(), text.data() + dots, line.range_low);
      const auto high = std::from_chars(text.data() + dots + 2, end, line.range_high);
      const std::string_view unit(high.ptr, static_cast<std::size_t>(end - high.ptr));
      line.unit = unit == " V"    ? SignalLine::Unit::kVolt
                  : unit == " mA" ? SignalLine::Unit::kMilliampere
                                  : SignalLine::Unit::kNone;
      if (low.ec == std::errc() && low.ptr == text.data() + dots && high.ec == std::errc() &&
          line.unit != SignalLine::Unit::kNone && line.range_low < line.range_high)
        return;
    }
    refuse("range_unreadable", "the range '" + text + "' is none; write it like \"0..10 V\" or \"4..20 mA\"");
  }

  template <class Word>
  [[nodiscard]] Word one_of(const char* column,
                            const std::vector<std::pair<std::string, Word>>& words) const {
    const std::string found = data_.text(row_, column);
    std::string known;
    for (const auto& [word, value] : words) {
      if (word == found) return value;
      if (!word.empty()) known += (known.empty() ? "" : ", ") + word;
    }
    refuse("word_unknown", std::string("'") + column + "' is '" + found + "'; write one of " + known);
  }

  const record::DataTable& data_;
  std::size_t row_;
};

SignalTable table_of(const record::DataTable& data) {
  SignalTable table{.file = data.file, .title = data.title, .lines = {}};
  for (std::size_t row = 0; row < data.rows.size(); ++row) table.lines.push_back(RowReader(data, row).line());
  std::sort(table.lines.begin(), table.lines.end(), [](const SignalLine& a, const SignalLine& b) {
    return std::pair(a.kind, a.index) < std::pair(b.kind, b.index);
  });
  const auto refuse = [&](const char* code, const std::string& text) {
    throw Error(ErrorKind::kBadInput, code, text, {data.file, 0, 0});
  };
  std::set<std::tuple<std::string, unsigned, unsigned>> wires;
  std::array<int, 4> next{};
  for (const SignalLine& line : table.lines) {
    int& expected = next[static_cast<std::size_t>(line.kind)];
    if (line.index != expected)
      refuse("signal_gap", "the signals of a kind must count from 0 without gaps or doubles, and at '" +
                               line.signal + "' they do not; renumber them");
    ++expected;
    if (!wires.emplace(line.device, line.subdevice, line.channel).second)
      refuse("channel_twice",
             "'" + line.signal + "' is on a channel that another signal has; give each its own");
  }
  if (table.count(Kind::kOutput) == 0)
    refuse("outputs_missing", "has no output, so there is nothing to control; add ao0");
  if (table.count(Kind::kEncoder) + table.count(Kind::kInput) == 0)
    refuse("inputs_missing", "has neither encoder nor input; add what the controller is to see");
  return table;
}

}  // namespace

int SignalTable::count(SignalLine::Kind kind) const noexcept {
  return static_cast<int>(std::count_if(lines.begin(), lines.end(),
                                        [kind](const SignalLine& line) { return line.kind == kind; }));
}

SignalTable read_signal_table(const std::filesystem::path& path) {
  return table_of(record::read_data(path));
}

SignalTable parse_signal_table(const std::string& text, const std::string& file) {
  return table_of(record::parse_data(text, file));
}

}  // namespace isac::card
