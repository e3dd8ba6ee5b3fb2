// Runs inside QEMU as the only program: the Comedi back end and supervised runs on the kernel's own drivers.
// Prints a line per check; the last line is RESULT PASS or RESULT FAIL. Times are the guest's.
#include <comedi.h>
#include <comedilib.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "isac/card/comedi_card.hpp"
#include "isac/core/error.hpp"
#include "isac/core/units.hpp"
#include "isac/record/arm_file.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/runtime/control_session.hpp"
#include "isac/runtime/control_setup.hpp"
#include "isac/runtime/stop_signals.hpp"

namespace {

using namespace isac;
using runtime::ControlOutcome;
using runtime::LoopEnd;
using runtime::SupervisorEnd;

int failures = 0;

void check(bool holds, const std::string& what) {
  fmt::print("{} {}\n", holds ? "ok  " : "FAIL", what);
  std::fflush(stdout);
  failures += holds ? 0 : 1;
}

/// Puts the driver `board` behind a legacy device.
bool attach(const char* device, const char* board) {
  const int fd = ::open(device, O_RDWR);
  if (fd < 0) return false;
  comedi_devconfig config{};
  std::strncpy(config.board_name, board, sizeof config.board_name - 1);
  const bool done = ::ioctl(fd, COMEDI_DEVCONFIG, &config) == 0;
  ::close(fd);
  return done;
}

void set_fault(const char* name, int value) {
  std::ofstream("/sys/module/isac_rig/parameters/" + std::string(name)) << value;
}

int beats() {
  int count = -1;
  std::ifstream("/sys/module/isac_rig/parameters/beats") >> count;
  return count;
}

/// The outputs as another program sees them.
std::string outputs(const char* device) {
  comedi_t* handle = comedi_open(device);
  std::string text;
  for (unsigned channel = 0; handle != nullptr && channel < 2; ++channel) {
    lsampl_t code = 9999;
    comedi_data_read(handle, 1, channel, 0, AREF_GROUND, &code);
    text += (text.empty() ? "" : ",") + std::to_string(code);
  }
  if (handle != nullptr) comedi_close(handle);
  return text;
}

std::string table_head(const char* title) {
  return std::string("format = \"isac.data/1\"\ntitle = \"") + title +
         "\"\norigin = \"test\"\nlicence = \"none\"\n[units]\nsubdevice = \"-\"\nchannel = \"-\"\nvented = "
         "\"count\"\n";
}
std::string row(const std::string& signal, const char* device, int subdevice, int channel,
                const std::string& more) {
  return fmt::format("[[row]]\nsignal = \"{}\"\ndevice = \"{}\"\nsubdevice = {}\nchannel = {}\n{}\n", signal,
                     device, subdevice, channel, more);
}
std::string write_table(const char* name, const char* sensors) {
  std::string text = table_head(name) + row("enc0", "/dev/comedi0", 2, 0, "driver = \"isac_rig\"");
  for (int i = 0; i < 8; ++i) text += row("ai" + std::to_string(i), sensors, 0, i, "range = \"0..10 V\"");
  for (int i = 0; i < 2; ++i)
    text += row("ao" + std::to_string(i), "/dev/comedi0", 1, i, "range = \"4..20 mA\"");
  text += row("heartbeat", "/dev/comedi0", 3, 0, "");
  const std::string path = std::string("/") + name + ".toml";
  std::ofstream(path) << text;
  return path;
}

/// The kernel's own test driver loops its outputs to its inputs.
void comedi_test_card(const char* device) {
  std::string text = table_head("comedi_test");
  for (int i = 0; i < 8; ++i) {
    text += row("ai" + std::to_string(i), device, 0, i, "driver = \"comedi_test\"\nrange = \"-10..10 V\"");
    text += row("ao" + std::to_string(i), device, 1, i, "range = \"-10..10 V\"\nvented = 32768");
  }
  const card::Opened opened = card::open_comedi(card::parse_signal_table(text, "comedi_test"));
  const card::Shape shape = opened.card->shape();
  check(shape.inputs == 8 && shape.outputs == 8 && shape.input_max_code == 65535 &&
            shape.output_max_code == 32767,
        "comedi_test: 8 inputs of 16 bit, 8 outputs from 0 V up");
  int wrong = 0;
  card::Command command;
  card::Sample sample;
  std::int64_t before = -1;
  for (std::uint32_t k = 0; k < 200; ++k) {
    for (std::uint32_t i = 0; i < 8; ++i) command.output[i] = (k * 163 + i * 4001) % 32768;
    wrong += ok(opened.card->write(command)) && ok(opened.card->read(sample)) ? 0 : 1;
    for (std::size_t i = 0; i < 8; ++i) wrong += sample.input[i] == command.output[i] + 32768 ? 0 : 1;
    wrong += sample.time_ns > before ? 0 : 1;
    before = sample.time_ns;
  }
  check(wrong == 0, fmt::format("comedi_test: 200 cycles looped from output to input, {} wrong", wrong));
  command.output[3] = 32768;
  check(opened.card->write(command) == Status::kOutOfRange,
        "comedi_test: a code beyond the range is refused");
  check(ok(opened.card->vent()) && ok(opened.card->read(sample)) && sample.input[0] == 32768 &&
            sample.input[7] == 32768,
        "comedi_test: vented is 0 V");
}

/// Does something to the run, from beside its loop, once the controller is at work.
class Saboteur final : public runtime::RunObserver {
 public:
  explicit Saboteur(std::function<void()> act) : act_(std::move(act)) {}
  void started(const runtime::RealTime* real_time, const std::vector<std::string>&) override {
    if (real_time != nullptr && !real_time->complete()) fmt::print("note {}\n", real_time->words());
  }
  void status(const runtime::Live& live) override {
    if (done_ || live.phase.load() != static_cast<int>(runtime::Phase::kControl)) return;
    done_ = true;
    if (act_) act_();
  }
  bool agrees() override { return true; }

 private:
  std::function<void()> act_;
  bool done_ = false;
};

struct Wish {
  std::string table, name;
  double seconds = 30.0;
  std::function<void()> act;
  int joints = 1;
  std::int64_t beat_limit = 10'000'000;  ///< ns
  bool line = false;                     ///< of the hand, the arm compensated, instead of a sine
};

/// The seed's arm in a pose that its inverse kinematics likes, with the testbed's muscles: the rig in the kernel has no better.
void along_a_line(runtime::ControlRun& run) {
  record::ArmFile arm = record::read_arm("/right_soft_arm.toml");
  arm.middle = {0, -kPi / 4, -kPi / 4, 0, kPi / 2, 0};
  models::ParameterTable six;
  six.joint_count = 6;
  runtime::compensate_arm(run.settings, arm, six, "right_soft_arm.toml");
  run.motion.kind = runtime::Motion::Kind::kLine;
  run.motion.rest = 0.2;
  run.motion.duration = 0.1;
  run.motion.path = std::make_shared<runtime::LinePath>(
      runtime::reach_of(arm, run.settings, "right_soft_arm.toml"), models::JointVector<double, 6>{},
      std::vector<runtime::LinePiece>{{true, {0, 0, 0.05}}, {true, {0, 0.03, 0}}}, 0.2);
}

ControlOutcome run(const Wish& wish) {
  runtime::ControlRun run;
  run.card = "comedi:" + wish.table;
  run.joints = wish.joints;
  run.settings = runtime::testbed_control_settings(run.rig, {});
  run.settings.joint.fill(run.settings.joint[0]);
  run.settings.run_up = 0.1;
  for (auto& watch : run.settings.watch) watch.following = 10;  // the rig in the kernel is no muscle pair
  run.motion = {.kind = runtime::Motion::Kind::kSine,
                .size = 0.1,
                .frequency = 1.0,
                .duration = wish.seconds,
                .points = {},
                .path = {}};
  if (wish.line) along_a_line(run);
  run.log = "/" + wish.name + ".csv";
  run.flight = "/" + wish.name + ".flight.csv";
  run.beat.beat = wish.beat_limit;
  Saboteur saboteur(wish.act);
  static const std::atomic<bool> never{false};
  return runtime::run_control(run, saboteur, never);
}

void loop_in_time(const std::string& table, const std::string& name, int joints, const char* angle_column,
                  bool line = false) {
  const int beats_before = beats();
  const ControlOutcome outcome =
      run({.table = table, .name = name, .seconds = 1.0, .act = {}, .joints = joints, .line = line});
  const auto edges = beats() - beats_before;
  check(outcome.as_planned() && outcome.loop.why == LoopEnd::Why::kDone,
        name + ": played to its end at 2 kHz");
  check(outcome.loop.late == 0,
        fmt::format("{}: {} cycles, {} late, longest {:.1f} us behind its time", name, outcome.loop.cycles,
                    outcome.loop.late, 1e-3 * static_cast<double>(outcome.loop.longest_late_ns)));
  check(outcome.rows == static_cast<std::uint64_t>(outcome.loop.cycles) && outcome.dropped == 0,
        fmt::format("{}: {} rows logged, {} lost", name, outcome.rows, outcome.dropped));
  const auto log = record::read_recording("/" + name + ".csv");
  double most = 0;
  for (const double angle : log.column(angle_column).values) most = std::max(most, std::abs(angle));
  check(most > 0.02, fmt::format("{}: the joint in the kernel moved to {:.3f} rad", name, most));
  check(outputs("/dev/comedi0") == "0,0", name + ": valves closed afterwards");
  if (joints > 1) return;  // the arm's table has no heartbeat
  // One edge a cycle; the last cycle and the end leave it low.
  check(std::abs(edges - outcome.loop.cycles) <= 2,
        fmt::format("{}: {} edges of the heartbeat in {} cycles", name, edges, outcome.loop.cycles));
}

void dies(const std::string& table, const std::string& name, const std::function<void()>& act,
          SupervisorEnd::Why why, std::int64_t beat_limit) {
  const ControlOutcome outcome = run({.table = table, .name = name, .act = act, .beat_limit = beat_limit});
  const std::string held = outputs("/dev/comedi0");
  const int edges = beats();
  ::usleep(20'000);
  check(beats() == edges, name + ": the heartbeat stands still");
  check(!outcome.told && outcome.supervisor.why == why && held == "0,0",
        fmt::format("{}: valves closed {:.2f} ms after the last beat, outputs now {}", name,
                    1e-6 * static_cast<double>(outcome.supervisor.silent_ns), held));
  const auto flight = record::read_recording("/" + name + ".flight.csv");
  check(flight.rows() >= 50, fmt::format("{}: {} last cycles kept", name, flight.rows()));
}

void faults(const std::string& table, const std::string& name, const char* parameter, int value,
            control::FaultCode code, const char* says) {
  const ControlOutcome outcome =
      run({.table = table, .name = name, .act = [=] { set_fault(parameter, value); }});
  const std::string held = outputs("/dev/comedi0");
  set_fault(parameter, 0);
  const auto flight = record::read_recording("/" + name + ".flight.csv");
  // The cycle that found the fault closed the valves; how long before was the last good one?
  const auto& time = flight.column("time").values;
  const double span = time.size() > 1 ? 1e3 * (time.back() - time[time.size() - 2]) : -1;
  check(outcome.told && outcome.loop.cause.code == code && held == "0,0" &&
            outcome.diagnosis.find(says) != std::string::npos && flight.column("ao0").values.back() == 0.0,
        fmt::format(
            "{}: {} {}; vented in the cycle that found it, {:.2f} ms after the last good one, outputs now {}",
            name, runtime::finding_words(outcome.loop.cause), outcome.diagnosis, span, held));
}

/// A dead board: a reading stalls for a second and then fails, as comedi_timeout() has it.
void stalls(const std::string& table, const std::string& name, double least_ms, double most_ms) {
  const auto act = [] {
    set_fault("stall_ms", 1000);  // first, so that no reading fails without having stalled
    set_fault("fail_read", ETIMEDOUT);
  };
  const ControlOutcome outcome = run({.table = table, .name = name, .act = act});
  set_fault("stall_ms", 0);
  set_fault("fail_read", 0);
  const double silent = 1e-6 * static_cast<double>(outcome.supervisor.silent_ns);
  const std::string held = outputs("/dev/comedi0");
  check(outcome.supervisor.why == SupervisorEnd::Why::kHung && silent > least_ms && silent < most_ms &&
            held == "0,0",
        fmt::format("{}: valves closed {:.2f} ms after the last beat, outputs now {}", name, silent, held));
}

void all() {
  using Why = SupervisorEnd::Why;
  using control::FaultCode;
  constexpr std::int64_t kUsual = 10'000'000,
                         kPatient = 5'000'000'000;  // patient: so that only death can be the reason
  check(attach("/dev/comedi0", "isac_rig") && attach("/dev/comedi1", "isac_rig"), "isac_rig attached twice");
  const std::string two = write_table("two_cards", "/dev/comedi1"),
                    one = write_table("one_card", "/dev/comedi0");
  comedi_test_card("/dev/comedi2");
  loop_in_time(two, "testbed", 1, "angle");
  loop_in_time("/soft_arm.toml", "soft_arm", 6, "phi1");
  loop_in_time("/soft_arm.toml", "line", 6, "phi2", true);
  dies(
      two, "SIGKILL", [] { raise(SIGKILL); }, Why::kDied, kPatient);
  dies(
      two, "abort", [] { std::abort(); }, Why::kDied, kPatient);
  dies(
      two, "SIGSEGV", [] { raise(SIGSEGV); }, Why::kDied, kPatient);
  dies(
      two, "hang", [] { raise(SIGSTOP); }, Why::kHung, kUsual);
  faults(two, "fail_read", "fail_read", EIO, FaultCode::kReadFailed, "ai0 (/dev/comedi1");
  faults(two, "empty", "empty", 1, FaultCode::kInputCode, "");
  faults(two, "enc_jump", "enc_jump", 500, FaultCode::kEncoderJump, "");
  // With the valves on a card of their own: the beat's limit, the poll, and a margin. On one card: when the reading ends.
  stalls(two, "stall_two_cards", 10, 15);
  stalls(one, "stall_one_card", 900, 1100);
}

}  // namespace

int main() {
  try {
    const runtime::StopSignals signals;
    all();
  } catch (const std::exception& error) {
    check(false, error.what());
  }
  fmt::print("RESULT {}\n", failures == 0 ? "PASS" : "FAIL");
  std::fflush(stdout);
  return failures;
}
