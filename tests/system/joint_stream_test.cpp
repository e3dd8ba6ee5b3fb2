// isac-identify joint --stream: the same answer in bounded memory.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "testbed_data.hpp"

namespace {

namespace fs = std::filesystem;

/// Runs the program and returns its largest resident memory in MB; the answer goes into `json`.
double run(const fs::path& folder, const std::string& extra, const fs::path& json, int& status) {
  const std::string command =
      std::string("exec '") + ISAC_BIN_DIR + "/isac-identify' joint '" + folder.string() + "' " + extra +
      " --loss squared --differentiator 21:3 --json '" + json.string() + "' > /dev/null 2>&1";
  const pid_t child = fork();
  if (child == 0) {
    execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    _exit(127);
  }
  rusage usage{};
  wait4(child, &status, 0, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

nlohmann::json parameters(const fs::path& json) {
  std::ifstream in(json);
  return nlohmann::json::parse(in).at("parameters");
}

}  // namespace

TEST(JointStream, gives_the_answer_in_memory_that_does_not_grow_with_the_file) {
  const fs::path folder = fs::temp_directory_path() / ("isac-stream-" + std::to_string(getpid()));
  const isac::test::TestbedTruth truth;
  double peak[2] = {};
  for (const int size : {0, 1}) {
    fs::create_directories(folder);
    std::ofstream(folder / "rig.toml") << isac::test::rig_toml(truth);
    const double seconds = size == 0 ? 120 : 480;
    for (const int dp : {-1, 1})
      isac::test::write_sweep(folder / ("fast" + std::to_string(dp) + ".csv"), truth,
                              {.name = "fast",
                               .seconds = seconds,
                               .amplitude = 0.4,
                               .peak_speed = 6.0,
                               .delta_pressure = static_cast<double>(dp)},
                              static_cast<std::uint32_t>(7 + dp));
    int streamed = -1, whole = -1;
    peak[size] = run(folder, "--stream", folder / "stream.json", streamed);
    const double in_memory = run(folder, "", folder / "whole.json", whole);
    ASSERT_EQ(streamed, 0);
    ASSERT_EQ(whole, 0);
    const auto a = parameters(folder / "stream.json"), b = parameters(folder / "whole.json");
    for (const char* name : {"A", "B", "C", "D"})
      // The weights come from a pilot and are not settled twice: within a third of a standard error.
      EXPECT_NEAR(a.at(name).at("value").get<double>(), b.at(name).at("value").get<double>(),
                  b.at(name).at("std_error").get<double>() / 3)
          << name;
    if (size == 1) {
      EXPECT_LT(peak[1], in_memory);
    }
    fs::remove_all(folder);
  }
  EXPECT_LT(peak[1], peak[0] + 8.0)
      << "MB: four times the rows, the same memory but for the allocator's mood";
}
