// Tables of signals: those of data/cards, and what is refused.
#include "isac/card/signal_table.hpp"

#include <gtest/gtest.h>

#include "isac/core/error.hpp"

namespace isac::test {
namespace {

using card::SignalLine;
using Kind = SignalLine::Kind;

std::string with_rows(const std::string& rows) {
  return "format = \"isac.data/1\"\ntitle = \"t\"\norigin = \"o\"\nlicence = \"l\"\n[units]\nsubdevice = "
         "\"-\"\n"
         "channel = \"-\"\nvented = \"count\"\n" +
         rows;
}
std::string row(const std::string& signal, const std::string& more, int channel = 0) {
  return "[[row]]\nsignal = \"" + signal +
         "\"\ndevice = \"/dev/comedi0\"\nsubdevice = 0\nchannel = " + std::to_string(channel) + "\n" + more +
         "\n";
}
const std::string kAo0 = row("ao0", "range = \"4..20 mA\"", 20);

std::string refused(const std::string& rows) {
  try {
    static_cast<void>(card::parse_signal_table(with_rows(rows), "table.toml"));
  } catch (const Error& error) {
    EXPECT_EQ(error.place().file, "table.toml");
    return error.code();
  }
  return "taken";
}

TEST(SignalTable, of_the_seeds_cards_and_of_a_present_day_pair_are_read) {
  const auto count = [](const char* name) {
    const card::SignalTable t =
        card::read_signal_table(std::string(ISAC_SOURCE_DIR) + "/data/cards/" + name + ".toml");
    return std::array{t.count(Kind::kEncoder), t.count(Kind::kInput), t.count(Kind::kOutput)};
  };
  EXPECT_EQ(count("testbed"), (std::array{1, 8, 2}));
  EXPECT_EQ(count("soft_arm"), (std::array{6, 0, 12}));
  EXPECT_EQ(count("s626_pci1724"), (std::array{6, 8, 12}));
}

TEST(SignalTable, reads_every_column) {
  const card::SignalTable t = card::parse_signal_table(
      with_rows(row("ai0", "driver = \"x\"\nrange = \"-10..10 V\"\nreference = \"differential\"", 3) +
                row("ao0", "range = \"0..10 V\"\nvented = 12", 4) +
                row("enc0", "setup = \"quadrature x4\"", 5)),
      "t");
  ASSERT_EQ(t.lines.size(), 3u);
  EXPECT_EQ(t.lines[0].setup, SignalLine::Setup::kQuadratureX4);
  EXPECT_EQ(t.lines[1].driver, "x");
  EXPECT_EQ(t.lines[1].range_low, -10);
  EXPECT_EQ(t.lines[1].reference, SignalLine::Reference::kDifferential);
  EXPECT_EQ(t.lines[1].channel, 3u);
  EXPECT_EQ(t.lines[2].vented, 12u);
  EXPECT_EQ(t.lines[2].unit, SignalLine::Unit::kVolt);
}

TEST(SignalTable, refuses_what_cannot_be_wired) {
  EXPECT_EQ(refused(row("ai0", "range = \"0..10 V\"") + kAo0), "taken");
  EXPECT_EQ(refused(row("aj0", "range = \"0..10 V\"") + kAo0), "signal_unknown");
  EXPECT_EQ(refused(row("ai8", "range = \"0..10 V\"") + kAo0), "signal_unknown");
  EXPECT_EQ(refused(row("ai0", "") + kAo0), "range_unreadable");
  EXPECT_EQ(refused(row("ai0", "range = \"10..0 V\"") + kAo0), "range_unreadable");
  EXPECT_EQ(refused(row("ai0", "range = \"0..10 kV\"") + kAo0), "range_unreadable");
  EXPECT_EQ(refused(row("ai1", "range = \"0..10 V\"") + kAo0), "signal_gap");
  EXPECT_EQ(refused(row("ai0", "range = \"0..10 V\"") + row("ai0", "range = \"0..10 V\"", 1) + kAo0),
            "signal_gap");
  EXPECT_EQ(refused(row("ai0", "range = \"0..10 V\"") + row("ai1", "range = \"0..10 V\"") + kAo0),
            "channel_twice");
  EXPECT_EQ(refused(row("ai0", "range = \"0..10 V\"")), "outputs_missing");
  EXPECT_EQ(refused(kAo0), "inputs_missing");
  EXPECT_EQ(refused(row("enc0", "range = \"0..10 V\"") + kAo0), "value_out_of_place");
  EXPECT_EQ(refused(row("enc0", "") + row("heartbeat", "", 1) + kAo0), "taken");
  EXPECT_EQ(refused(row("enc0", "") + row("heartbeat", "range = \"0..5 V\"", 1) + kAo0),
            "value_out_of_place");
  EXPECT_EQ(refused(row("enc0", "") + row("heartbeat", "", 1) + row("heartbeat", "", 2) + kAo0),
            "signal_gap");
  EXPECT_EQ(refused(row("enc0", "") + row("heartbeat1", "", 1) + kAo0), "signal_unknown");
  EXPECT_EQ(refused(row("enc0", "setup = \"x2\"") + kAo0), "word_unknown");
  EXPECT_EQ(refused(row("ai0", "range = \"0..10 V\"\nsetup = \"preload\"") + kAo0), "value_out_of_place");
  EXPECT_EQ(refused(row("ai0", "range = \"0..10 V\"\nreference = \"air\"") + kAo0), "word_unknown");
  EXPECT_EQ(refused(row("ai0", "range = \"0..10 V\"\ncolour = \"red\"") + kAo0), "column_unknown");
  EXPECT_EQ(refused("[[row]]\nsignal = \"ai0\"\ndevice = \"d\"\nchannel = 0\nrange = \"0..10 V\"\n" + kAo0),
            "value_out_of_range");
  EXPECT_EQ(refused("[[row]]\nsignal = \"ai0\"\nsubdevice = 0\nchannel = 0\nrange = \"0..10 V\"\n" + kAo0),
            "value_missing");
}

}  // namespace
}  // namespace isac::test
