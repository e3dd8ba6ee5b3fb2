// The Comedi back end on boards that do what the kernel's drivers do: tables of data/cards, and every way a card fails.
#include <comedi.h>
#include <gtest/gtest.h>

#include <string>

#include "comedi_fake.hpp"
#include "isac/core/error.hpp"
#include "isac/record/data_tables.hpp"

namespace isac::test {
namespace {

using card::Command;
using card::Opened;
using card::Sample;

card::SignalTable table(const char* name) {
  return card::read_signal_table(std::string(ISAC_SOURCE_DIR) + "/data/cards/" + name + ".toml");
}
Opened open(const card::SignalTable& signals) {
  return card::open_comedi(signals, std::make_unique<FakeClock>());
}

class Comedi : public testing::Test {
 protected:
  void SetUp() override {
    boards().clear();
    add_board("/dev/comedi0", controller_board());
    add_board("/dev/comedi1", labpc_board());
  }
  FakeBoard& controller() { return boards().at("/dev/comedi0"); }
  FakeBoard& labpc() { return boards().at("/dev/comedi1"); }
  static std::string refused(const card::SignalTable& signals) {
    try {
      static_cast<void>(open(signals));
    } catch (const Error& error) {
      return error.code() + ": " + error.text();
    }
    return "opened";
  }
};

TEST_F(Comedi, testbed_has_the_shape_of_the_seeds_cards) {
  const Opened opened = open(table("testbed"));
  const card::Shape shape = opened.card->shape();
  EXPECT_EQ(shape.encoders, 1);
  EXPECT_EQ(shape.inputs, 8);
  EXPECT_EQ(shape.outputs, 2);
  EXPECT_EQ(shape.encoder_modulus, 1u << 24);
  EXPECT_EQ(shape.input_max_code, 4095u);
  EXPECT_EQ(shape.output_max_code, 4095u);
  ASSERT_EQ(opened.remarks.size(), 1u);  // the encoder is on the valves' card, the sensors are not
  EXPECT_NE(opened.remarks[0].find("/dev/comedi0"), std::string::npos);
}

TEST_F(Comedi, arm_has_six_encoders_and_twelve_valves_in_the_order_of_table_c5) {
  const Opened opened = open(table("soft_arm"));
  EXPECT_EQ(opened.card->shape().encoders, 6);
  EXPECT_EQ(opened.card->shape().outputs, 12);
  Command command;
  for (std::uint32_t i = 0; i < 12; ++i) command.output[i] = 100 * i;
  ASSERT_EQ(opened.card->write(command), Status::kOk);
  for (std::uint32_t i = 0; i < 12; ++i) EXPECT_EQ(controller().subdevices[1].value[i], 100 * i);
}

TEST_F(Comedi, present_day_pair_is_14_bit_and_its_counters_are_set_up) {
  add_board("/dev/comedi0", s626_board());
  add_board("/dev/comedi1", pci1724_board());
  const Opened opened = open(table("s626_pci1724"));
  EXPECT_EQ(opened.card->shape().input_max_code, 0x3fffu);
  EXPECT_EQ(opened.card->shape().output_max_code, 0x3fffu);
  EXPECT_EQ(boards().at("/dev/comedi0").configurations, 7);  // six counters, and the heartbeat's direction
  EXPECT_EQ(boards().at("/dev/comedi0").last_configuration,
            std::vector<std::uint32_t>{INSN_CONFIG_DIO_OUTPUT});
  EXPECT_TRUE(opened.card->shape().heartbeat);
  EXPECT_TRUE(opened.remarks.empty());
}

TEST_F(Comedi, every_gain_of_the_io_card_is_the_range_that_the_driver_has_for_it) {
  // Table E.7: gains 1 to 100, unipolar. The driver numbers seven bipolar ranges before them.
  const record::DataTable gains = record::read_data(std::string(ISAC_SOURCE_DIR) + "/data/io_card.toml");
  ASSERT_EQ(gains.rows.size(), 7u);
  for (std::size_t k = 0; k < gains.rows.size(); ++k) {
    EXPECT_NEAR(gains.number(k, "range"), 10 / gains.number(k, "gain"), 1e-12);
    card::SignalTable signals = table("testbed");
    for (card::SignalLine& line : signals.lines) {
      if (line.kind == card::SignalLine::Kind::kInput && line.index == 3)
        line.range_high = gains.number(k, "range");
    }
    const Opened opened = open(signals);
    EXPECT_EQ(opened.card->shape().input_max_code, 4095u);
    EXPECT_EQ(labpc().range_read[signals.lines[4].channel], 7 + k) << gains.number(k, "gain");
  }
}

TEST_F(Comedi, heartbeat_is_a_digital_line_that_a_second_handle_leaves_alone) {
  card::SignalTable signals = table("testbed");
  signals.lines.push_back({.kind = card::SignalLine::Kind::kHeartbeat,
                           .signal = "heartbeat",
                           .device = "/dev/comedi0",
                           .driver = {},
                           .subdevice = 3,
                           .range_text = {}});
  const std::uint32_t& line = controller().subdevices[3].value[0];
  const Opened opened = open(signals);
  EXPECT_TRUE(opened.card->shape().heartbeat);
  EXPECT_EQ(opened.card->beat(true), Status::kOk);
  EXPECT_EQ(line, 1u);
  {
    const Opened supervisors = open(signals);
    EXPECT_EQ(line, 1u);
    EXPECT_EQ(supervisors.card->vent(), Status::kOk);
  }
  EXPECT_EQ(line, 1u);  // it tells of the loop, not of the supervisor
  EXPECT_EQ(opened.card->beat(false), Status::kOk);
  EXPECT_EQ(line, 0u);
  controller().fail_writes = true;
  EXPECT_EQ(opened.card->beat(true), Status::kDeviceError);
  controller().fail_writes = false;
  signals.lines.back().subdevice = 1;
  signals.lines.back().channel = 5;
  EXPECT_EQ(refused(signals),
            "table_misfit: heartbeat (/dev/comedi0, subdevice 1, channel 5): the subdevice is of another "
            "kind than the "
            "signal");
}

TEST_F(Comedi, one_call_reads_a_device_and_another_writes_one) {
  const Opened opened = open(table("testbed"));
  controller().subdevices[2].value[0] = 77;
  labpc().subdevices[0].value[6] = 1234;
  controller().lists = labpc().lists = 0;
  Sample sample;
  ASSERT_EQ(opened.card->read(sample), Status::kOk);
  EXPECT_EQ(sample.encoder[0], 77u);
  EXPECT_EQ(sample.input[6], 1234u);
  EXPECT_EQ(controller().lists + labpc().lists, 2);
  ASSERT_EQ(opened.card->write({}), Status::kOk);
  EXPECT_EQ(controller().lists, 2);
}

TEST_F(Comedi, failed_reading_does_not_keep_the_valves_from_closing) {
  const Opened opened = open(table("testbed"));
  Command command;
  command.output = {3000, 2000};
  ASSERT_EQ(opened.card->write(command), Status::kOk);
  labpc().fail_subdevice = 0;
  labpc().fail_channel = 4;
  Sample sample;
  EXPECT_EQ(opened.card->read(sample), Status::kDeviceError);
  EXPECT_FALSE(controller().closed(1));
  EXPECT_EQ(opened.card->vent(), Status::kOk);
  EXPECT_TRUE(controller().closed(1));
  EXPECT_EQ(opened.card->diagnose(), "ai4 (/dev/comedi1, subdevice 0, channel 4): Connection timed out");
}

TEST_F(Comedi, every_device_is_vented_also_when_one_fails) {
  FakeBoard second = controller_board();
  add_board("/dev/comedi2", second);
  card::SignalTable signals = table("testbed");
  signals.lines.back().device = "/dev/comedi2";  // ao1
  const Opened opened = open(signals);
  Command command;
  command.output = {3000, 2000};
  ASSERT_EQ(opened.card->write(command), Status::kOk);
  controller().fail_writes = true;
  EXPECT_EQ(opened.card->vent(), Status::kDeviceError);
  EXPECT_TRUE(boards().at("/dev/comedi2").closed(1));
  Command held;
  ASSERT_EQ(opened.card->outputs(held), Status::kOk);
  EXPECT_EQ(held.output[0], 3000u);  // nothing is claimed that did not happen
}

TEST_F(Comedi, write_that_the_driver_refuses_is_an_error) {
  const Opened opened = open(table("testbed"));
  controller().fail_writes = true;
  EXPECT_EQ(opened.card->write({}), Status::kDeviceError);
}

TEST_F(Comedi, code_of_a_missing_card_is_passed_on_to_the_loops_watch) {
  const Opened opened = open(table("testbed"));
  labpc().empty_slot = true;
  Sample sample;
  EXPECT_EQ(opened.card->read(sample), Status::kOk);
  EXPECT_EQ(sample.input[0], 65535u);
}

TEST_F(Comedi, empty_slot_is_found_when_the_card_is_opened) {
  labpc().empty_slot = true;
  EXPECT_EQ(refused(table("testbed")),
            "card_absent: ai0 (/dev/comedi1, subdevice 0, channel 0) reads 65535, which its converter does "
            "not have: "
            "nobody is in that slot; check address and power");
  EXPECT_EQ(controller().open_handles, 0);
  EXPECT_EQ(labpc().open_handles, 0);
}

TEST_F(Comedi, card_that_does_not_answer_is_found_when_it_is_opened) {
  labpc().fail_subdevice = 0;
  labpc().fail_channel = 2;
  EXPECT_NE(refused(table("testbed")).find("card_absent: the card does not answer: ai2"), std::string::npos);
}

TEST_F(Comedi, missing_device_is_said_with_what_to_look_at) {
  boards().erase("/dev/comedi1");
  const std::string said = refused(table("testbed"));
  EXPECT_NE(said.find("/dev/comedi1 cannot be opened (No such device)"), std::string::npos) << said;
  EXPECT_NE(said.find("iocard"), std::string::npos) << said;
}

TEST_F(Comedi, table_that_does_not_fit_the_card_is_refused) {
  const auto with = [](const std::function<void(card::SignalLine&)>& change, card::SignalLine::Kind kind) {
    card::SignalTable signals = table("testbed");
    for (card::SignalLine& line : signals.lines)
      if (line.kind == kind && line.index == 0) change(line);
    return refused(signals);
  };
  using Kind = card::SignalLine::Kind;
  using Line = card::SignalLine;
  EXPECT_NE(with([](Line& l) { l.driver = "s626"; }, Kind::kInput).find("are two cards exchanged"),
            std::string::npos);
  EXPECT_NE(with([](Line& l) { l.subdevice = 7; }, Kind::kInput).find("no such subdevice"),
            std::string::npos);
  EXPECT_NE(with([](Line& l) { l.channel = 12; }, Kind::kOutput).find("no such channel"), std::string::npos);
  EXPECT_NE(with([](Line& l) { l.subdevice = 1; }, Kind::kEncoder).find("of another kind"),
            std::string::npos);
  EXPECT_NE(with([](Line& l) { l.range_high = 8; }, Kind::kInput).find("has no range"), std::string::npos);
  EXPECT_NE(with([](Line& l) { l.unit = Line::Unit::kVolt; }, Kind::kOutput).find("has no range"),
            std::string::npos);
}

TEST_F(Comedi, bipolar_output_needs_to_be_told_which_code_is_closed) {
  controller().subdevices[1].ranges = {{-10, 10, 0}};
  card::SignalTable signals = table("testbed");
  for (card::SignalLine& line : signals.lines) {
    if (line.kind != card::SignalLine::Kind::kOutput) continue;
    line.range_low = -10, line.range_high = 10, line.unit = card::SignalLine::Unit::kVolt;
  }
  const std::string said = refused(signals);  // code 0 is -10 V, and comedi_to_phys must not call it NaN
  EXPECT_NE(said.find("code 0 means -10.0"), std::string::npos) << said;
  EXPECT_NE(said.find("write vented = 2048"), std::string::npos) << said;
  for (card::SignalLine& line : signals.lines)
    if (line.kind == card::SignalLine::Kind::kOutput) line.vented = 2048;
  const Opened opened = open(signals);
  EXPECT_EQ(opened.card->shape().output_max_code, 2047u);
  Command command;
  command.output = {1000, 0};
  ASSERT_EQ(opened.card->write(command), Status::kOk);
  EXPECT_EQ(controller().subdevices[1].value[0], 3048u);
  ASSERT_EQ(opened.card->vent(), Status::kOk);
  EXPECT_EQ(controller().subdevices[1].value[0], 2048u);
}

TEST_F(Comedi, counter_of_32_bits_is_used_modulo_a_smaller_power_of_two) {
  controller().subdevices[2].maxdata = 0xffffffff;
  const Opened opened = open(table("testbed"));
  EXPECT_EQ(opened.card->shape().encoder_modulus, 1u << 31);
  controller().subdevices[2].value[0] = 0xffffffff;
  Sample sample;
  ASSERT_EQ(opened.card->read(sample), Status::kOk);
  EXPECT_EQ(sample.encoder[0], 0x7fffffffu);
}

TEST_F(Comedi, sensors_and_valves_on_one_device_are_remarked_on) {
  card::SignalTable signals = table("testbed");
  for (card::SignalLine& line : signals.lines) {
    if (line.kind == card::SignalLine::Kind::kInput) line.device = "/dev/comedi0", line.driver.clear();
  }
  std::erase_if(signals.lines, [](const card::SignalLine& line) {
    return line.kind == card::SignalLine::Kind::kInput && line.index > 3;
  });
  const Opened opened = open(signals);
  ASSERT_EQ(opened.remarks.size(), 1u);
  EXPECT_NE(opened.remarks[0].find("put the valves on a card of their own"), std::string::npos);
}

TEST_F(Comedi, name_leads_to_the_table) {
  EXPECT_NO_THROW(
      static_cast<void>(card::open("comedi:" + std::string(ISAC_SOURCE_DIR) + "/data/cards/soft_arm.toml")));
  EXPECT_THROW(static_cast<void>(card::open("comedi:")), Error);
  EXPECT_THROW(static_cast<void>(card::open("comedi:/nowhere.toml")), Error);
}

}  // namespace
}  // namespace isac::test
