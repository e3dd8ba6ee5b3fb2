// What stays of a run: log, flight recorder, comparison of commands, points of a motion, jitter.
#include <gtest/gtest.h>

#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <vector>

#include "control_bench.hpp"
#include "isac/core/error.hpp"
#include "isac/record/csv_reader.hpp"
#include "isac/runtime/flight_recorder.hpp"
#include "isac/runtime/real_time.hpp"
#include "isac/runtime/ring_writer.hpp"
#include "isac/runtime/run_log.hpp"

namespace isac::test {
namespace {

namespace fs = std::filesystem;

class Folder : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "isac-run-XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  fs::path folder_;
};

TEST(RingWriter, never_makes_the_loop_wait_for_a_stalled_disk) {
  std::mutex mutex;
  std::condition_variable wake;
  bool stalled = true;
  runtime::RingWriter<int> writer(
      [&](const int&) {
        std::unique_lock lock(mutex);
        wake.wait(lock, [&] { return !stalled; });
      },
      64);
  int taken = 0;
  for (int k = 0; k < 1000; ++k) taken += writer.push(k) ? 1 : 0;
  EXPECT_GE(taken, 64);
  EXPECT_LE(taken, 65);  // the ring, and one in the consumer's hands
  EXPECT_EQ(writer.dropped(), 1000u - static_cast<unsigned>(taken));
  {
    const std::scoped_lock lock(mutex);
    stalled = false;
  }
  wake.notify_all();
  writer.finish();
  EXPECT_FALSE(writer.failed());
}

TEST(RingWriter, tells_the_loop_that_its_consumer_failed_and_throws_the_reason_at_the_end) {
  runtime::RingWriter<int> writer([](const int&) { throw std::runtime_error("disk full"); }, 8);
  writer.push(1);
  while (!writer.failed()) std::this_thread::yield();
  EXPECT_THROW(writer.finish(), std::runtime_error);
}

TEST(FlightRecorder, keeps_the_last_cycles_in_order_and_leaves_out_the_slot_that_may_be_torn) {
  constexpr std::size_t kRows = 100;
  std::vector<std::max_align_t> memory(runtime::FlightRecorder::bytes(kRows) / sizeof(std::max_align_t) + 1);
  runtime::FlightRecorder flight(memory.data(), kRows);
  EXPECT_TRUE(flight.rows().empty());
  runtime::CycleRow row;
  for (int k = 0; k < 60; ++k) row.cycle = k, flight.push(row);
  ASSERT_EQ(flight.rows().size(), 60u);
  for (int k = 60; k < 1234; ++k) row.cycle = k, flight.push(row);
  const auto rows = flight.rows();
  ASSERT_EQ(rows.size(), kRows - 1);
  for (std::size_t k = 0; k < rows.size(); ++k)
    ASSERT_EQ(rows[k].cycle, 1234 - static_cast<std::int64_t>(kRows - 1 - k));
}

TEST_F(Folder, log_gives_every_number_back_to_the_last_bit) {
  Bench bench;
  bench.run_in();
  const runtime::JointWiring wiring = runtime::wire_joints(bench.rig, bench.card.shape(), 1);
  std::vector<runtime::CycleRow> rows;
  {
    runtime::RunLog log(folder_ / "run.csv", wiring, {{"experiment", "closed-loop"}});
    for (int k = 0; k < 200; ++k) {
      bench.director.wanted.joint[0].angle = 0.1 / 3.0 * std::sin(0.1 * k);
      bench.card.encoder = k % 7;
      bench.cycles(1);
      rows.push_back(bench.loop->row());
      log.append(rows.back());
      log.append(rows.back());  // a row whose time stands still is left out
    }
    log.close();
  }
  const series::Recording read = record::read_recording(folder_ / "run.csv");
  ASSERT_EQ(read.rows(), rows.size());
  runtime::CommandComparer comparer(read, 1);
  for (std::size_t k = 0; k < rows.size(); ++k) {
    ASSERT_EQ(std::llround(read.column("time").values[k] * 1e9), rows[k].time_ns);
    ASSERT_EQ(read.column("p1_cmd").values[k], rows[k].joint[0].p1_cmd);
    ASSERT_EQ(read.column("angle_wanted").values[k], rows[k].joint[0].aim.angle);
    ASSERT_EQ(read.column("enc0").values[k], rows[k].sample.encoder[0]);
    ASSERT_EQ(read.column("ao1").values[k], rows[k].command.output[1]);
    comparer.compare(rows[k]);
  }
  EXPECT_EQ(comparer.result().rows, rows.size());
  EXPECT_EQ(comparer.result().different, 0u);
}

TEST_F(Folder, one_bit_of_one_command_is_a_difference) {
  Bench bench;
  bench.run_in();
  bench.cycles(1);
  runtime::CycleRow row = bench.loop->row();
  runtime::RunLog log(folder_ / "run.csv", runtime::wire_joints(bench.rig, bench.card.shape(), 1), {});
  log.append(row);
  log.close();
  runtime::CommandComparer comparer(record::read_recording(folder_ / "run.csv"), 1);
  row.joint[0].p1_cmd = std::nextafter(row.joint[0].p1_cmd, 0.0);
  comparer.compare(row);
  EXPECT_EQ(comparer.result().different, 1u);
  EXPECT_GT(comparer.result().largest, 0.0);
}

TEST_F(Folder, torn_last_line_of_a_log_is_dropped_and_the_rest_is_whole) {
  Bench bench;
  bench.run_in();
  {
    runtime::RunLog log(folder_ / "run.csv", runtime::wire_joints(bench.rig, bench.card.shape(), 1), {});
    for (int k = 0; k < 20; ++k) {
      bench.cycles(1);
      log.append(bench.loop->row());
    }
    log.close();
  }
  // As SIGKILL in the middle of a line leaves it: no closing line, the last row cut.
  std::ifstream file(folder_ / "run.csv");
  std::string text((std::istreambuf_iterator<char>(file)), {});
  text.resize(text.find("# closed:"));
  text.resize(text.size() - 15);
  const series::Recording read = record::read_recording(write("torn.csv", text));
  EXPECT_EQ(read.rows(), 19u);
  EXPECT_FALSE(read.meta("torn_line").empty());
}

std::vector<control::JointLimits<double>> limits() {
  return {control::JointLimits<double>{}};
}

std::string refused(const fs::path& path) {
  try {
    static_cast<void>(runtime::read_points(path, limits()));
  } catch (const Error& error) {
    return error.code();
  }
  return "taken";
}

TEST_F(Folder, points_are_checked_before_anything_moves) {
  EXPECT_EQ(refused(write("good.csv", "time [s],angle [deg]\n0,0\n1,30\n2,-30\n")), "taken");
  EXPECT_EQ(refused(write("far.csv", "time [s],angle [deg]\n0,0\n1,68\n")),
            "point_unreachable");  // 67.5 is 3/8 pi
  EXPECT_EQ(refused(write("fast.csv", "time [s],angle [deg]\n0,0\n0.1,60\n")), "point_too_fast");
  EXPECT_EQ(refused(write("one.csv", "time [s],angle [deg]\n0,0\n")), "points_too_few");
  EXPECT_EQ(refused(write("hole.csv", "time [s],angle [deg]\n0,0\n1,\n2,0\n")), "point_missing");
}

TEST_F(Folder, points_are_followed_straight_from_one_to_the_next) {
  runtime::Motion motion;
  motion.kind = runtime::Motion::Kind::kPoints;
  motion.points = runtime::read_points(write("p.csv", "time [s],angle [rad]\n5,0.2\n6,0.4\n8,0\n"), limits());
  motion.duration = 10;
  const std::atomic<bool> permit{true};
  runtime::MotionDirector director(motion, permit);
  runtime::Wanted wanted;
  const auto angle_at = [&](double time) {
    EXPECT_TRUE(director.at({.control_time = time, .phase = runtime::Phase::kControl, .angle = {}}, wanted));
    return wanted.joint[0].angle;
  };
  EXPECT_TRUE(
      director.at({.phase = runtime::Phase::kRunUp, .angle = {0.2}}, wanted));  // found where they begin
  EXPECT_NEAR(angle_at(0.0), 0.2, 1e-15);
  EXPECT_NEAR(angle_at(0.25), 0.25, 1e-15);
  EXPECT_NEAR(wanted.joint[0].velocity, 0.2, 1e-15);
  EXPECT_NEAR(angle_at(2.0), 0.2, 1e-15);
  EXPECT_NEAR(wanted.joint[0].velocity, -0.2, 1e-15);
  EXPECT_NEAR(angle_at(3.0), 0.0, 1e-15);
  EXPECT_NEAR(angle_at(9.0), 0.0, 1e-15);
  EXPECT_EQ(wanted.joint[0].velocity, 0.0);
  EXPECT_FALSE(director.at({.control_time = 10.0, .phase = runtime::Phase::kControl, .angle = {}}, wanted));
}

TEST_F(Folder, points_are_approached_smoothly_from_wherever_the_joint_was_found) {
  runtime::Motion motion;
  motion.kind = runtime::Motion::Kind::kPoints;
  motion.points = runtime::read_points(write("p.csv", "time [s],angle [rad]\n0,0.2\n1,0.4\n"), limits());
  motion.duration = 1;
  const std::atomic<bool> permit{true};
  runtime::MotionDirector director(motion, permit);
  runtime::Wanted wanted;
  EXPECT_TRUE(director.at({.phase = runtime::Phase::kRunUp, .angle = {-0.3}}, wanted));
  // 0.5 rad at 0.5 rad/s at the fastest: 1.5 s. Then the points, and the end after their second.
  double last = -0.3, fastest = 0;
  for (int k = 0; k < 3000; ++k) {
    ASSERT_TRUE(
        director.at({.control_time = 5e-4 * k, .phase = runtime::Phase::kControl, .angle = {}}, wanted));
    fastest = std::max(fastest, (wanted.joint[0].angle - last) / 5e-4);
    EXPECT_GE(wanted.joint[0].angle, last);
    last = wanted.joint[0].angle;
  }
  EXPECT_NEAR(fastest, 0.5, 1e-3);
  EXPECT_NEAR(last, 0.2, 1e-6);
  EXPECT_TRUE(director.at({.control_time = 2.0, .phase = runtime::Phase::kControl, .angle = {}}, wanted));
  EXPECT_NEAR(wanted.joint[0].angle, 0.3, 1e-12);
  EXPECT_FALSE(director.at({.control_time = 2.5, .phase = runtime::Phase::kControl, .angle = {}}, wanted));
}

TEST(MotionDirector, arms_only_with_permission_and_plausible_samples) {
  std::atomic<bool> permit{false};
  runtime::MotionDirector director({.size = 0.1, .points = {}}, permit);
  runtime::Wanted wanted;
  EXPECT_TRUE(director.at({.plausible = true, .angle = {}}, wanted));
  EXPECT_FALSE(wanted.arm);
  permit = true;
  EXPECT_TRUE(director.at({.plausible = false, .angle = {}}, wanted));
  EXPECT_FALSE(wanted.arm);
  EXPECT_TRUE(director.at({.plausible = true, .angle = {}}, wanted));
  EXPECT_TRUE(wanted.arm);
}

TEST(Wiring, puts_six_joints_on_the_controller_cards_pins) {
  const card::Shape shape{.encoders = 6, .inputs = 0, .outputs = 12};
  const runtime::JointWiring wiring = runtime::wire_joints({}, shape, 6);
  for (int k = 0; k < 6; ++k) {
    const auto& lines = wiring.joint[static_cast<std::size_t>(k)];
    EXPECT_EQ(lines.encoder, k);
    EXPECT_EQ(lines.valve_1.channel, 2 * k);  // VnchM of table C.5
    EXPECT_EQ(lines.valve_2.channel, 2 * k + 1);
    EXPECT_EQ(lines.valve_1.code(5 * kPascalPerKgfCm2, 4095), 4095u);  // 20 mA, 5 kg/cm2
    EXPECT_FALSE(lines.measures_force());
  }
  EXPECT_THROW(static_cast<void>(runtime::wire_joints({}, {.encoders = 1, .outputs = 2}, 2)), Error);
}

TEST(Jitter, quantiles_are_those_of_the_sorted_wake_ups) {
  runtime::Jitter jitter;
  for (int k = 0; k <= 1000; ++k) jitter.late.push_back(k);
  EXPECT_EQ(jitter.quantile(0.5), 500);
  EXPECT_EQ(jitter.quantile(0.999), 999);
  EXPECT_EQ(jitter.quantile(1.0), 1000);
  EXPECT_TRUE(std::isnan(runtime::Jitter{}.quantile(0.5)));
}

TEST(Jitter, no_wake_up_is_early_and_late_ones_are_never_caught_up) {
  const std::atomic<bool> stop{false};
  const runtime::Jitter jitter = runtime::measure_jitter(0.2, 1000, stop);
  ASSERT_FALSE(jitter.late.empty());
  EXPECT_GE(jitter.late.front(), 0.0);
  EXPECT_GE(static_cast<std::int64_t>(jitter.late.size()) + jitter.skipped,
            200);  // each slot is taken or skipped
}

TEST(RealTime, says_plainly_what_is_missing) {
  runtime::RealTime none;
  none.fifo_error = EPERM;
  none.lock_error = ENOMEM;
  EXPECT_FALSE(none.complete());
  EXPECT_NE(none.words().find("no SCHED_FIFO (Operation not permitted; run as root"), std::string::npos)
      << none.words();
  EXPECT_NE(none.words().find("memory not locked (Cannot allocate memory"), std::string::npos)
      << none.words();
}

}  // namespace
}  // namespace isac::test
