#include "isac/runtime/run_log.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace isac::runtime {
namespace {

constexpr int kExact = -1;
constexpr int kNanoseconds = 9;

struct JointColumn {
  const char* name;
  const char* alone;  ///< its name where there is one joint
  const char* unit;
  double (*value)(const JointCycle&);
};

constexpr JointColumn kJointColumns[] = {
    {"phi", "angle", "rad", [](const JointCycle& j) { return j.angle; }},
    {"velocity_", "velocity", "rad/s", [](const JointCycle& j) { return j.velocity; }},
    {"p1_cmd_", "p1_cmd", "Pa", [](const JointCycle& j) { return j.p1_cmd; }},
    {"p2_cmd_", "p2_cmd", "Pa", [](const JointCycle& j) { return j.p2_cmd; }},
    {"angle_wanted_", "angle_wanted", "rad", [](const JointCycle& j) { return j.aim.angle; }},
    {"velocity_wanted_", "velocity_wanted", "rad/s", [](const JointCycle& j) { return j.aim.velocity; }},
    {"acceleration_wanted_", "acceleration_wanted", "rad/s2",
     [](const JointCycle& j) { return j.aim.acceleration; }},
    {"torque_wanted_", "torque_wanted", "N m", [](const JointCycle& j) { return j.aim.torque; }},
    {"torque_model_", "torque_model", "N m", [](const JointCycle& j) { return j.torque; }},
    {"torque_asked_", "torque_asked", "N m", [](const JointCycle& j) { return j.asked_torque; }},
    {"limited_", "limited", "1", [](const JointCycle& j) { return static_cast<double>(j.limited); }},
};
constexpr JointColumn kPressureColumns[] = {
    {"p1_", "p1", "Pa", [](const JointCycle& j) { return j.p1; }},
    {"p2_", "p2", "Pa", [](const JointCycle& j) { return j.p2; }},
};
constexpr JointColumn kForceColumns[] = {
    {"F1_", "F1", "N", [](const JointCycle& j) { return j.F1; }},
    {"F2_", "F2", "N", [](const JointCycle& j) { return j.F2; }},
};

/// Calls give(column, joint) for every joint's columns in the order of the file.
template <class Give>
void each_joint_column(const JointWiring& wiring, Give give) {
  for (int k = 0; k < wiring.joints; ++k) {
    const JointLines& lines = wiring.joint[static_cast<std::size_t>(k)];
    for (const JointColumn& column : kJointColumns) give(column, k);
    if (lines.measures_pressure())
      for (const JointColumn& column : kPressureColumns) give(column, k);
    if (lines.measures_force())
      for (const JointColumn& column : kForceColumns) give(column, k);
  }
}

std::vector<record::LogColumn> columns_of(const JointWiring& wiring) {
  std::vector<record::LogColumn> columns = {{"time", "s", kNanoseconds}};
  each_joint_column(wiring, [&](const JointColumn& column, int joint) {
    const std::string name = wiring.joints == 1 ? column.alone : column.name + std::to_string(joint + 1);
    columns.push_back({name, column.unit, kExact});
  });
  for (const char* name : {"phase", "state", "mode", "arm", "answered", "warnings", "fault"})
    columns.push_back({name, "1", 0});
  const auto add = [&columns](const char* prefix, int count) {
    for (int i = 0; i < count; ++i) columns.push_back({prefix + std::to_string(i), "count", 0});
  };
  add("enc", wiring.shape.encoders);
  add("ai", wiring.shape.inputs);
  add("ao", wiring.shape.outputs);
  return columns;
}

}  // namespace

RunLog::RunLog(const std::filesystem::path& path, const JointWiring& wiring,
               const std::map<std::string, std::string>& metadata)
    : wiring_(wiring), log_(path, columns_of(wiring), metadata) {}

void RunLog::append(const CycleRow& row) {
  if (row.time_ns <= last_ns_) return;
  last_ns_ = row.time_ns;
  values_.assign({1e-9 * static_cast<double>(row.time_ns)});
  each_joint_column(wiring_, [&](const JointColumn& column, int joint) {
    values_.push_back(column.value(row.joint[static_cast<std::size_t>(joint)]));
  });
  for (const int value :
       {static_cast<int>(row.phase), static_cast<int>(row.state), static_cast<int>(row.mode),
        static_cast<int>(row.arm), static_cast<int>(row.answered), static_cast<int>(row.warnings),
        static_cast<int>(row.finding.code)})
    values_.push_back(value);
  const auto add = [this](const auto& codes, int count) {
    for (int i = 0; i < count; ++i)
      values_.push_back(static_cast<double>(codes[static_cast<std::size_t>(i)]));
  };
  add(row.sample.encoder, wiring_.shape.encoders);
  add(row.sample.input, wiring_.shape.inputs);
  add(row.command.output, wiring_.shape.outputs);
  log_.append(values_);
}

CommandComparer::CommandComparer(const series::Recording& run, int joints) : joints_(joints) {
  const auto& time = run.column("time").values;
  const auto& answered = run.column("answered").values;
  commands_.resize(time.size());
  for (std::size_t k = 0; k < time.size() && answered[k] != 0.0; ++k)
    times_.push_back(std::llround(time[k] * 1e9));
  for (int j = 0; j < joints; ++j) {
    const std::string behind = joints == 1 ? std::string() : std::string("_").append(std::to_string(j + 1));
    const auto &p1 = run.column("p1_cmd" + behind).values, &p2 = run.column("p2_cmd" + behind).values;
    for (std::size_t k = 0; k < times_.size(); ++k)
      commands_[k][static_cast<std::size_t>(j)] = {p1[k], p2[k]};
  }
}

void CommandComparer::compare(const CycleRow& row) noexcept {
  while (next_ < times_.size() && times_[next_] < row.time_ns) ++next_;
  if (next_ >= times_.size() || times_[next_] != row.time_ns) return;
  ++result_.rows;
  bool same = true;
  for (int j = 0; j < joints_; ++j) {
    const auto i = static_cast<std::size_t>(j);
    const auto& then = commands_[next_][i];
    const std::array<double, 2> now = {row.joint[i].p1_cmd, row.joint[i].p2_cmd};
    for (std::size_t m = 0; m < 2; ++m) {
      same = same && std::bit_cast<std::uint64_t>(then[m]) == std::bit_cast<std::uint64_t>(now[m]);
      result_.largest = std::max(result_.largest, std::abs(then[m] - now[m]));
    }
  }
  if (!same && result_.different++ == 0) result_.first_different = 1e-9 * static_cast<double>(row.time_ns);
}

}  // namespace isac::runtime
