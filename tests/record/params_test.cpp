#include "isac/record/params.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>

#include "isac/core/error.hpp"

namespace isac::record {
namespace {

const std::filesystem::path kFixture =
    std::filesystem::path(ISAC_SOURCE_DIR) / "fixtures/params/testbed.toml";

std::string text_of(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream out;
  out << stream.rdbuf();
  return out.str();
}

/// A folder that goes away with the test.
class Folder {
 public:
  Folder() {
    std::random_device device;
    path_ = std::filesystem::temp_directory_path() / ("isac_params_" + std::to_string(device()));
    std::filesystem::create_directories(path_);
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  [[nodiscard]] std::filesystem::path operator/(const char* name) const { return path_ / name; }
  [[nodiscard]] std::size_t files() const {
    std::size_t n = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(path_)) ++n;
    return n;
  }

 private:
  std::filesystem::path path_;
};

/// Same bits, and every NaN equal to every other of its sign.
bool same(double a, double b) {
  return std::isnan(a) ? std::isnan(b) && std::signbit(a) == std::signbit(b)
                       : std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

/// A section of one value without uncertainty.
ParamsSection section_of(std::string name, std::string label, std::string value_name, std::string unit,
                         double value) {
  Estimated estimate;
  estimate.name = std::move(value_name);
  estimate.unit = std::move(unit);
  estimate.value = value;
  ParamsSection section;
  section.name = std::move(name);
  section.label = std::move(label);
  section.values.push_back(estimate);
  return section;
}

void expect_same(const ParamsSection& a, const ParamsSection& b) {
  ASSERT_EQ(a.name, b.name);
  ASSERT_EQ(a.label, b.label);
  ASSERT_EQ(a.sources, b.sources);
  ASSERT_EQ(a.constants.size(), b.constants.size());
  for (std::size_t i = 0; i < a.constants.size(); ++i) {
    ASSERT_EQ(a.constants[i].first, b.constants[i].first);
    ASSERT_TRUE(same(a.constants[i].second, b.constants[i].second));
  }
  const double box_a[] = {a.box.delta_pressure_low, a.box.delta_pressure_high, a.box.angle_low,
                          a.box.angle_high,         a.box.speed_low,           a.box.speed_high};
  const double box_b[] = {b.box.delta_pressure_low, b.box.delta_pressure_high, b.box.angle_low,
                          b.box.angle_high,         b.box.speed_low,           b.box.speed_high};
  for (int i = 0; i < 6; ++i)
    ASSERT_TRUE(same(box_a[i], box_b[i])) << i << " " << box_a[i] << " " << box_b[i];
  ASSERT_EQ(a.values.size(), b.values.size());
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    const Estimated &x = a.values[i], &y = b.values[i];
    ASSERT_EQ(x.name, y.name);
    ASSERT_EQ(x.unit, y.unit);
    ASSERT_EQ(x.identifiable, y.identifiable);
    ASSERT_EQ(x.reason, y.reason);
    for (const auto& [u, v] : {std::pair{x.value, y.value},
                               {x.std_error, y.std_error},
                               {x.ci_low, y.ci_low},
                               {x.ci_high, y.ci_high}}) {
      ASSERT_TRUE(same(u, v)) << x.name << " " << u << " " << v;
    }
  }
}

TEST(Params, reads_values_boxes_constants_and_sources) {
  const Params params = read_params(kFixture);
  EXPECT_EQ(params.created, "2026-01-02T03:04:05Z");
  ASSERT_EQ(params.sections.size(), 2u);
  const ParamsSection* joint = params.find("joint", "testbed");
  ASSERT_NE(joint, nullptr);
  EXPECT_EQ(joint->sources.size(), 1u);
  EXPECT_EQ(joint->box.delta_pressure_high, 196133.0);
  EXPECT_EQ(joint->box.speed_low, -6.2);
  ASSERT_EQ(joint->values.size(), 4u);
  EXPECT_EQ(joint->values[0].name, "A");
  EXPECT_EQ(joint->values[0].value, -23450.0);
  EXPECT_EQ(joint->values[0].unit, "N/m");
  EXPECT_EQ(joint->values[0].std_error, 12.5);
  EXPECT_EQ(joint->values[0].ci_low, -23474.5);
  EXPECT_EQ(joint->constants[0], (std::pair<std::string, double>{"wheel_radius_m", 0.019}));
  const ParamsSection* pcu = params.find("pcu");
  ASSERT_NE(pcu, nullptr);
  EXPECT_EQ(pcu->values[2].name, "dead_time") << "order of the file";
  EXPECT_FALSE(pcu->values[2].identifiable);
  EXPECT_TRUE(std::isnan(pcu->values[2].value));
  EXPECT_EQ(pcu->values[2].reason, "Record a step at 1 kHz or more.");
  EXPECT_EQ(params.find("joint", "another"), nullptr);
}

TEST(Params, keeps_what_it_does_not_know) {
  const std::string once = format_params(read_params(kFixture));
  for (const char* part :
       {"note_of_the_lab", "room_of_tomorrow", "answer = 42", "2026-01-02", "deeper", "three"}) {
    EXPECT_NE(once.find(part), std::string::npos) << part;
  }
  EXPECT_EQ(format_params(parse_params(once, "once.toml")), once) << "writing again changes nothing";
}

TEST(Params, any_double_reads_back_to_the_same_bits) {
  std::mt19937_64 random(7);
  const double special[] = {0.0,
                            -0.0,
                            std::numeric_limits<double>::denorm_min(),
                            std::numeric_limits<double>::max(),
                            std::numeric_limits<double>::lowest(),
                            std::numeric_limits<double>::infinity(),
                            1e22,
                            1e23,
                            0.1,
                            -std::numeric_limits<double>::infinity(),
                            std::numeric_limits<double>::quiet_NaN(),
                            123456789012345678.0};
  std::size_t next = 0;
  const auto any = [&] {  // every bit pattern is as likely as any other
    if (next < std::size(special)) return special[next++];
    const double value = std::bit_cast<double>(random());
    return std::isnan(value) ? std::numeric_limits<double>::quiet_NaN() : value;
  };
  const auto known = [&] {
    double v = any();
    while (std::isnan(v)) v = any();
    return v;
  };
  for (int round = 0; round < 200; ++round) {
    Params params;
    params.created = "2026-01-02T03:04:05Z";
    const char* names[] = {"joint", "pcu", "gains", "masses", "effects", "muscle", "calibration of sensors"};
    for (int s = 0; s < 6; ++s) {
      ParamsSection section;
      section.name = names[random() % std::size(names)];
      section.label = "label " + std::to_string(s) + " \"ä\"\t.";
      section.sources = {"sha256:00 a.csv", "b\\c.csv"};
      section.box = {known(), known(), known(), any(), any(), known()};
      section.constants = {{"wheel_radius_m", any()}, {"odd name", any()}};
      for (int v = 0; v < 3; ++v) {
        Estimated value{.name = v == 0 ? "A" : "odd.name " + std::to_string(v),
                        .unit = "N/m",
                        .value = any(),
                        .std_error = std::abs(any()),
                        .ci_low = any(),
                        .ci_high = any(),
                        .identifiable = v != 1,
                        .reason = v == 1   ? "Sweep \"faster\"."
                                  : v == 2 ? "these runs do not tell it"
                                           : ""};
        section.values.push_back(value);
      }
      params.sections.push_back(section);
    }
    const Params back = parse_params(format_params(params), "round.toml");
    ASSERT_EQ(back.sections.size(), params.sections.size());
    for (std::size_t s = 0; s < back.sections.size(); ++s) {
      ASSERT_NO_FATAL_FAILURE(expect_same(params.sections[s], back.sections[s])) << format_params(params);
    }
  }
}

TEST(Params, update_replaces_its_sections_keeps_the_others_and_leaves_a_backup) {
  const Folder folder;
  const auto path = folder / "params.toml";
  std::filesystem::copy_file(kFixture, path);
  const std::string before = text_of(path);

  Params fresh;
  fresh.created = "2026-02-03T04:05:06Z";
  fresh.sections.push_back(section_of("pcu", "", "T_C", "s", 0.2));
  fresh.sections.push_back(section_of("joint", "second", "A", "N/m", -1));
  update_params(path, fresh);

  const Params after = read_params(path);
  EXPECT_EQ(after.created, fresh.created);
  ASSERT_EQ(after.sections.size(), 3u);
  expect_same(*after.find("joint", "testbed"), *read_params(kFixture).find("joint", "testbed"));
  EXPECT_EQ(after.find("pcu")->values.size(), 1u);
  EXPECT_EQ(after.find("joint", "second")->values[0].value, -1);
  EXPECT_NE(text_of(path).find("room_of_tomorrow"), std::string::npos);
  EXPECT_EQ(text_of(folder / "params.toml.bak"), before);
  EXPECT_EQ(folder.files(), 2u) << "no temporary file is left";
}

TEST(Params, update_of_a_corrupted_file_changes_nothing) {
  const Folder folder;
  const auto path = folder / "params.toml";
  const std::string torn = text_of(kFixture).substr(0, 700);
  std::ofstream(path, std::ios::binary) << torn;
  Params fresh;
  fresh.sections.push_back(section_of("pcu", "", "T_C", "s", 0.2));
  EXPECT_THROW(update_params(path, fresh), Error);
  EXPECT_EQ(text_of(path), torn);
  EXPECT_EQ(folder.files(), 1u);
}

TEST(Params, update_makes_the_file_where_there_is_none) {
  const Folder folder;
  Params fresh;
  fresh.sections.push_back(section_of("masses", "", "m1", "kg", 1.75));
  update_params(folder / "new.toml", fresh);
  EXPECT_EQ(read_params(folder / "new.toml").find("masses")->values[0].value, 1.75);
  EXPECT_EQ(folder.files(), 1u);
}

TEST(Params, any_cut_of_the_file_is_read_or_answered_with_an_error_of_its_place) {
  const std::string text = text_of(kFixture);
  for (std::size_t size = 0; size < text.size(); ++size) {
    try {
      (void)parse_params(text.substr(0, size), "cut.toml");
    } catch (const Error& error) {
      ASSERT_GE(error.place().line, 1) << error.what();
      ASSERT_EQ(error.place().file, "cut.toml");
    }
  }
}

}  // namespace
}  // namespace isac::record
