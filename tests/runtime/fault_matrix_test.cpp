// One sabotage after another in front of every back end: which fault it is, and how long the valves stay open, in virtual time.
// With ISAC_SHOW set it prints the table of docs/faults.md.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <limits>
#include <memory>
#include <ostream>

#include "control_bench.hpp"
#include "isac/card/replay_card.hpp"
#include "isac/card/sim_card.hpp"
#include "isac/card/sim_options.hpp"
#ifdef ISAC_HAVE_COMEDI
#include "../card/comedi_fake.hpp"
#endif

namespace isac::test {
namespace {

using control::FaultCode;
using control::RunState;

/// A card with a saboteur between it and the loop. Has a heartbeat line, whatever the card has.
class Sabotaged final : public card::Card {
 public:
  explicit Sabotaged(std::unique_ptr<card::Card> card) : card_(std::move(card)) {}
  [[nodiscard]] card::Shape shape() const noexcept override {
    card::Shape shape = card_->shape();
    shape.heartbeat = true;
    return shape;
  }
  Status wait_until(std::int64_t time_ns) noexcept override { return card_->wait_until(time_ns + late_ns); }
  Status read(card::Sample& sample) noexcept override {
    if (fail_read) return Status::kDeviceError;
    const Status status = card_->read(sample);
    stamp_ns = sample.time_ns;
    if (ok(status) && change) change(sample);
    return status;
  }
  Status write(const card::Command& command) noexcept override {
    return fail_write ? Status::kDeviceError : card_->write(command);
  }
  Status vent() noexcept override { return card_->vent(); }
  Status outputs(card::Command& command) const noexcept override { return card_->outputs(command); }
  Status beat(bool level) noexcept override {
    if (fail_beat) return Status::kDeviceError;
    beats += level != beat_level ? 1 : 0;
    beat_level = level;
    return Status::kOk;
  }
  [[nodiscard]] std::int64_t clock_ns() const noexcept override {
    return read_takes_ns > 0 ? stamp_ns + read_takes_ns : card_->clock_ns();
  }
  [[nodiscard]] bool closed() const {
    card::Command held;
    held.output.fill(1);
    EXPECT_EQ(card_->outputs(held), Status::kOk);
    return held.output == card::Command{}.output;
  }

  std::function<void(card::Sample&)> change;
  bool fail_read = false, fail_write = false, fail_beat = false, beat_level = false;
  int beats = 0;
  std::int64_t late_ns = 0, read_takes_ns = 0, stamp_ns = 0;

 private:
  std::unique_ptr<card::Card> card_;
};

runtime::ControlSettings settings() {
  runtime::ControlSettings made = runtime::testbed_control_settings({}, {});
  made.run_up = 0.01;
  for (auto& watch : made.watch) {
    watch.following = 0.05;
    watch.following_time = 0.05;
    watch.force = {.soft = 140, .hard = 150};
  }
  return made;
}

std::unique_ptr<card::Card> simulated() {
  return std::move(card::open_sim(std::make_shared<simulate::Rig>(card::parse_sim("jitter=off"))).card);
}

/// Codes of a second and a half of holding the simulated joint, to be replayed.
series::Recording recorded() {
  struct Keep final : runtime::CycleSink {
    explicit Keep(series::Recording& r) : to(r) {}
    bool take(const runtime::CycleRow& row) noexcept override {
      to.columns[0].values.push_back(1e-9 * static_cast<double>(row.sample.time_ns));
      to.columns[1].values.push_back(static_cast<double>(row.sample.encoder[0]));
      for (std::size_t i = 0; i < card::kInputs; ++i)
        to.columns[2 + i].values.push_back(static_cast<double>(row.sample.input[i]));
      return true;
    }
    series::Recording& to;
  };
  series::Recording recording;
  recording.source = "made by the test";
  recording.columns = {{"time", "s", {}}, {"enc0", "count", {}}};
  for (int i = 0; i < card::kInputs; ++i)
    recording.columns.push_back({"ai" + std::to_string(i), "count", {}});
  const auto card = simulated();
  runtime::ControlLoop loop(*card, runtime::wire_joints({}, card->shape(), 1), settings());
  EXPECT_EQ(loop.configure(), Status::kOk);
  TestDirector director;
  Keep keep(recording);
  for (int k = 0; k < 3000; ++k) static_cast<void>(loop.cycle(director, nullptr, &keep));
  return recording;
}

struct BackEnd {
  const char* name;
  std::unique_ptr<card::Card> (*open)();
  friend void PrintTo(const BackEnd& one, std::ostream* out) { *out << one.name; }
};

std::unique_ptr<card::Card> fake() {
  return std::make_unique<ControlCard>();
}
std::unique_ptr<card::Card> replayed() {
  static const series::Recording recording = recorded();
  return std::make_unique<card::ReplayCard>(recording);
}
#ifdef ISAC_HAVE_COMEDI
std::unique_ptr<card::Card> on_boards() {
  boards().clear();
  add_board("/dev/comedi0", controller_board());
  FakeBoard& sensors = add_board("/dev/comedi1", labpc_board());
  for (const record::RigChannel& force : {FakeCard::calibrated("F1"), FakeCard::calibrated("F2")})
    sensors.subdevices[0].value[FakeCard::channel(force)] = FakeCard::force_code(90);
  const auto table = card::read_signal_table(std::string(ISAC_SOURCE_DIR) + "/data/cards/testbed.toml");
  return std::move(card::open_comedi(table, std::make_unique<FakeClock>()).card);
}
#endif

std::vector<BackEnd> back_ends() {
  return {{"fake", fake},
          {"sim", simulated},
          {"replay", replayed},
#ifdef ISAC_HAVE_COMEDI
          {"boards", on_boards}
#endif
  };
}

struct Rig {
  explicit Rig(const BackEnd& back_end) : card(back_end.open()) {
    loop =
        std::make_unique<runtime::ControlLoop>(card, runtime::wire_joints({}, card.shape(), 1), settings());
    EXPECT_EQ(loop->configure(), Status::kOk);
  }
  void cycles(int count) {
    for (int k = 0; k < count; ++k) static_cast<void>(loop->cycle(director, nullptr, nullptr));
  }
  void run_in() {
    cycles(400);
    ASSERT_EQ(loop->row().phase, runtime::Phase::kControl) << runtime::finding_words(loop->row().finding);
    ASSERT_FALSE(card.closed());
  }
  Sabotaged card;
  TestDirector director;
  std::unique_ptr<runtime::ControlLoop> loop;
};

const std::size_t kForce = FakeCard::channel(FakeCard::calibrated("F1"));

struct Sabotage {
  int behaviour;  ///< of docs/faults.md
  const char* name;
  void (*act)(Rig&);
  FaultCode code;
  int good;  ///< cycles of sabotage that the loop bears before the one that vents
  friend void PrintTo(const Sabotage& one, std::ostream* out) { *out << one.name; }
};

const Sabotage kSabotages[] = {
    {4, "comes_late_each_time", [](Rig& r) { r.card.late_ns = 2 * kPeriodNs; }, FaultCode::kOverrun, 19},
    {5, "reading_takes_6_ms", [](Rig& r) { r.card.read_takes_ns = 6'000'000; }, FaultCode::kStaleSample, 0},
    {6, "wants_no_number",
     [](Rig& r) { r.director.wanted.joint[0].angle = std::numeric_limits<double>::quiet_NaN(); },
     FaultCode::kCommandNotFinite, 0},
    {7, "pulls_beyond_the_force_limit",
     [](Rig& r) { r.card.change = [](card::Sample& s) { s.input[kForce] = FakeCard::force_code(170); }; },
     FaultCode::kForceLimit, 20},
    {8, "does_not_follow", [](Rig& r) { r.director.wanted.joint[0].angle = 1.0; }, FaultCode::kFollowingError,
     101},  // 0.05 s are 100 cycles, and the watch sees what the cycle before wanted
    {9, "encoder_jumps",
     [](Rig& r) { r.card.change = [](card::Sample& s) { s.encoder[0] = (s.encoder[0] + 500) & 0xFFFFFFu; }; },
     FaultCode::kEncoderJump, 0},
    {10, "code_beyond_the_converter",
     [](Rig& r) { r.card.change = [](card::Sample& s) { s.input[kForce] = 65535; }; }, FaultCode::kInputCode,
     0},
    {10, "input_at_the_end_of_its_range",
     [](Rig& r) { r.card.change = [](card::Sample& s) { s.input[kForce] = 0; }; }, FaultCode::kInputAtEnd,
     199},
    {11, "reading_fails", [](Rig& r) { r.card.fail_read = true; }, FaultCode::kReadFailed, 0},
    {11, "writing_fails", [](Rig& r) { r.card.fail_write = true; }, FaultCode::kReadFailed, 0},
    {12, "heartbeat_cannot_be_written", [](Rig& r) { r.card.fail_beat = true; }, FaultCode::kReadFailed, 0},
};

class FaultMatrix : public testing::TestWithParam<std::tuple<Sabotage, BackEnd>> {};

TEST_P(FaultMatrix, vents_in_time_and_stays_vented) {
  const auto& [sabotage, back_end] = GetParam();
  Rig rig(back_end);
  ASSERT_NO_FATAL_FAILURE(rig.run_in());
  const std::int64_t before = rig.card.stamp_ns;
  sabotage.act(rig);
  int cycles = 0;
  while (!rig.card.closed() && cycles < 400) {
    rig.cycles(1);
    ++cycles;
  }
  EXPECT_EQ(rig.loop->machine().state(), RunState::kFaulted);
  EXPECT_EQ(rig.loop->machine().cause().code, sabotage.code)
      << runtime::finding_words(rig.loop->machine().cause());
  EXPECT_EQ(cycles, sabotage.good + 1);
  const std::int64_t after = rig.card.stamp_ns;
  if (std::getenv("ISAC_SHOW") != nullptr)
    std::printf("| %d | %s | %s | %d cycles | %.3f ms after the last good sample |\n", sabotage.behaviour,
                sabotage.name, back_end.name, cycles, 1e-6 * static_cast<double>(after - before));

  // 13: the cause is gone, the valves stay closed, the heartbeat still and low; an acknowledge and a new edge arm again.
  const int beats = rig.card.beats;
  rig.card.late_ns = rig.card.read_takes_ns = 0;
  rig.card.change = nullptr;
  rig.card.fail_read = rig.card.fail_write = rig.card.fail_beat = false;
  rig.director.wanted.joint[0].angle = 0;
  rig.cycles(300);
  EXPECT_EQ(rig.loop->machine().state(), RunState::kFaulted);
  EXPECT_EQ(rig.loop->machine().cause().code, sabotage.code);
  EXPECT_TRUE(rig.card.closed());
  EXPECT_LE(rig.card.beats - beats, 1);  // it may still go low
  EXPECT_FALSE(rig.card.beat_level);
  rig.director.arms = rig.director.wanted.arm = false;
  rig.director.wanted.acknowledge = true;
  rig.cycles(200);
  EXPECT_EQ(rig.loop->machine().state(), RunState::kDisarmed);
  rig.director.arms = true;
  rig.cycles(200);
  EXPECT_EQ(rig.loop->machine().state(), RunState::kArmed);
}

INSTANTIATE_TEST_SUITE_P(Matrix, FaultMatrix,
                         testing::Combine(testing::ValuesIn(kSabotages), testing::ValuesIn(back_ends())),
                         [](const auto& one) {
                           return std::string(std::get<0>(one.param).name) + "_on_" +
                                  std::get<1>(one.param).name;
                         });

class EveryBackEnd : public testing::TestWithParam<BackEnd> {};

TEST_P(EveryBackEnd, stays_closed_while_samples_are_not_plausible_however_often_it_is_armed) {  // 1
  Rig rig(GetParam());
  rig.card.change = [](card::Sample& s) { s.input[kForce] = 65535; };
  rig.director.arms = false;
  for (int k = 0; k < 1000; ++k) {
    rig.director.wanted.arm = k % 2 == 1;
    rig.cycles(1);
    ASSERT_TRUE(rig.card.closed()) << k;
  }
}

TEST_P(EveryBackEnd, is_closed_after_the_director_a_stop_and_the_end_of_the_loop) {  // 2
  for (const bool stopped : {false, true}) {
    Rig rig(GetParam());
    ASSERT_NO_FATAL_FAILURE(rig.run_in());
    rig.director.over = !stopped;
    const std::atomic<bool> stop{stopped};
    const runtime::LoopEnd end = rig.loop->run(rig.director, stop, nullptr, nullptr);
    EXPECT_EQ(end.why, stopped ? runtime::LoopEnd::Why::kStopped : runtime::LoopEnd::Why::kDone);
    EXPECT_TRUE(rig.card.closed());
    EXPECT_FALSE(rig.card.beat_level);
  }
}

INSTANTIATE_TEST_SUITE_P(Matrix, EveryBackEnd, testing::ValuesIn(back_ends()),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace isac::test
