// From params.toml to header, binary, CSV and Markdown; the header is compiled as C11, as C++20 and for a Cortex-M4.
#include "isac/record/tables.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "isac/core/error.hpp"
#include "isac/models/effects.hpp"
#include "isac/record/csv_reader.hpp"

namespace isac::record {
namespace {

using models::JointField;

Estimated estimate(std::string name, std::string unit, double value, double std_error = 0.01) {
  Estimated out;
  out.name = std::move(name);
  out.unit = std::move(unit);
  out.value = value;
  out.std_error = std_error;
  return out;
}

/// Tables 6.1 and 6.2 of the seed, the masses of table 4.1 and a friction on joint 2.
Params arm() {
  constexpr double kA[] = {-143000, -108000, -80600, -80600, -37600, -37600};
  constexpr double kB[] = {3200, 970, 334, 329, 138, 134};
  constexpr double kC[] = {0.0351, 0.0184, 0.0046, 0.0046, 0.0023, 0.0023};
  constexpr double kD[] = {2.20, 1.14, 0.286, 0.286, 0.143, 0.143};
  constexpr double kDiameter[] = {0.030, 0.025, 0.020, 0.020, 0.015, 0.015};
  constexpr double kGains[][4] = {{200, 80, 0.0065, 10}, {100, 25, 0.03, 10}, {25, 10, 0.12, 5},
                                  {25, 10, 0.12, 5},     {8, 2, 0.4, 10},     {8, 2, 0.4, 10}};
  Params params;
  params.created = "2026-01-02T03:04:05Z";
  for (int i = 0; i < 6; ++i) {
    ParamsSection joint;
    joint.name = "joint";
    joint.label = std::to_string(i + 1);
    joint.values = {estimate("A", "N/m", kA[i]), estimate("B", "N cm2/kg", kB[i]),
                    estimate("C", "N m s3", kC[i]), estimate("D", "N m s", kD[i])};
    joint.constants = {{"wheel_radius_m", kDiameter[i] / 2}, {"initial_pressure_Pa", 3.0 * 98066.5}};
    joint.box = {-196133, 196133, -1.178, 1.178, -6.28, 6.28};
    params.sections.push_back(joint);
    ParamsSection gains;
    gains.name = "gains";
    gains.label = joint.label;
    gains.values = {estimate("K_P_position", "N m/rad", kGains[i][0]),
                    estimate("K_I_position", "N m/rad s", kGains[i][1]),
                    estimate("K_P_torque", "kgf/cm2/N m", kGains[i][2]),
                    estimate("K_I_torque", "kgf/cm2/N m s", kGains[i][3])};
    params.sections.push_back(gains);
  }
  ParamsSection pcu;
  pcu.name = "pcu";
  pcu.values = {estimate("K_C", "-", 1.0), estimate("T_C", "ms", 170), estimate("dead_time", "s", 0.01),
                estimate("T_fill", "s", 0.18), estimate("T_vent", "s", 0.16)};
  params.sections.push_back(pcu);
  ParamsSection masses;
  masses.name = "masses";
  masses.values = {estimate("m1", "kg", 1.75), estimate("m2", "kg", 0.45), estimate("m3", "g", 140)};
  params.sections.push_back(masses);
  ParamsSection friction;
  friction.name = "effects";
  friction.label = "coulomb_friction";
  friction.values = {estimate("coulomb_friction", "N m", 0.25)};
  friction.constants = {{"joint", 2}};
  params.sections.push_back(friction);
  return params;
}

class Folder {
 public:
  Folder() {
    std::random_device device;
    path = std::filesystem::temp_directory_path() / ("isac_tables_" + std::to_string(device()));
    std::filesystem::create_directories(path);
  }
  ~Folder() { std::filesystem::remove_all(path); }
  std::filesystem::path path;
};

struct Outcome {
  int code = -1;
  std::string output;
};

Outcome run(const std::string& command) {
  Outcome result;
  FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return result;
  char buffer[512];
  while (std::fgets(buffer, sizeof buffer, pipe) != nullptr) result.output += buffer;
  result.code = WEXITSTATUS(pclose(pipe));
  return result;
}

bool have(const char* program) {
  return run(std::string("command -v ") + program).code == 0;
}

void write(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

TEST(Tables, carry_the_arm_in_si) {
  Warnings warnings;
  const models::ParameterTable table = parameter_table(arm(), &warnings);
  EXPECT_TRUE(warnings.empty());
  EXPECT_EQ(table.joint_count, 6);
  EXPECT_EQ(table.joints[0][JointField::kA], -143000);
  EXPECT_NEAR(table.joints[0][JointField::kB], 3200 / 98066.5, 1e-17);  // one rounding of 0.0326
  EXPECT_EQ(table.joints[4][JointField::kWheelRadius], 0.0075);
  EXPECT_NEAR(table.joints[2][JointField::kTorqueP], 0.12 * 98066.5, 1e-11);  // two roundings of 1.2e4
  EXPECT_EQ(table.joints[3][JointField::kPositionI], 10);
  for (int i = 0; i < 6; ++i)
    EXPECT_NEAR(table.joints[i][JointField::kValveLag], 0.17, 1e-16) << "one valve unit for all";
  EXPECT_EQ(table.joints[5][JointField::kValveLagFill], 0.18);
  EXPECT_EQ(table.joints[5][JointField::kValveLagVent], 0.16);
  EXPECT_EQ(table.joints[5][JointField::kAngleHigh], 1.178);
  EXPECT_TRUE(table.has_masses);
  EXPECT_NEAR(table.masses[2], 0.14, 1e-16);
  ASSERT_EQ(table.effect_count, 1);
  EXPECT_EQ(table.effects[0].joint, 1);
  EXPECT_EQ(table.effects[0].id_hash, models::effect_id_hash("coulomb_friction"));
  EXPECT_EQ(table.effects[0].parameters[0], 0.25);
}

TEST(Tables, binary_gives_the_same_table_back) {
  const DeploymentTables tables = make_tables(arm());
  models::ParameterTable back;
  ASSERT_EQ(models::load_parameter_table(tables.binary, back), Status::kOk);
  EXPECT_EQ(back, parameter_table(arm()));
}

TEST(Tables, a_binary_of_version_1_written_once_is_read_for_ever) {
  const std::filesystem::path folder = std::filesystem::path(ISAC_SOURCE_DIR) / "fixtures/params";
  std::ifstream stream(folder / "testbed.bin", std::ios::binary);
  const std::string text((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  models::ParameterTable stored;
  ASSERT_EQ(models::load_parameter_table(std::as_bytes(std::span(text)), stored), Status::kOk);
  EXPECT_EQ(stored, parameter_table(read_params(folder / "testbed.toml")));
  EXPECT_EQ(stored.joints[0][JointField::kA], -23450);
  EXPECT_EQ(stored.joints[0][JointField::kWheelRadius], 0.019);
}

TEST(Tables, terms_under_their_catalogue_names_reach_their_places) {
  Params params;
  ParamsSection joint;
  joint.name = "joint";
  joint.values = {estimate("viscous_damping", "N m s", 0.14), estimate("coulomb_friction", "N m", 0.3)};
  params.sections.push_back(joint);
  const models::ParameterTable table = parameter_table(params);
  EXPECT_EQ(table.joints[0][JointField::kD], 0.14);
  ASSERT_EQ(table.effect_count, 1);
  EXPECT_EQ(table.effects[0].joint, 0);
}

TEST(Tables, an_effect_of_several_parameters_is_deployed_in_the_catalogues_order_or_not_at_all) {
  const auto& info =
      models::effect_catalogue()[static_cast<std::size_t>(models::find_effect("stribeck_friction"))];
  ASSERT_GE(info.parameter_count, 2);
  Params params;
  ParamsSection joint;
  joint.name = "joint";
  for (int i = info.parameter_count - 1; i >= 0; --i) {  // in the file the last comes first
    joint.values.push_back(estimate(std::string("stribeck_friction.") + info.parameters[i].name,
                                    info.parameters[i].unit, 0.5 + i));
  }
  params.sections.push_back(joint);
  const models::ParameterTable whole = parameter_table(params);
  ASSERT_EQ(whole.effect_count, 1);
  EXPECT_EQ(whole.effects[0].id_hash, models::effect_id_hash("stribeck_friction"));
  EXPECT_EQ(whole.effects[0].parameter_count, info.parameter_count);
  for (int i = 0; i < info.parameter_count; ++i) {
    EXPECT_EQ(whole.effects[0].parameters[static_cast<std::size_t>(i)],
              (0.5 + i) * info.parameters[i].si_per_unit);
  }

  params.sections[0].values.pop_back();
  Warnings warnings;
  EXPECT_EQ(parameter_table(params, &warnings).effect_count, 0);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].text.find("lacks one of its parameters"), std::string::npos);
}

TEST(Tables, what_is_not_identifiable_is_left_out_and_said) {
  Params params = arm();
  params.sections[0].values[2].identifiable = false;
  params.sections[0].values[2].reason = "Sweep faster.";
  const DeploymentTables tables = make_tables(params);
  ASSERT_EQ(tables.warnings.size(), 1u);
  EXPECT_NE(tables.warnings[0].text.find("Sweep faster."), std::string::npos);
  models::ParameterTable back;
  ASSERT_EQ(models::load_parameter_table(tables.binary, back), Status::kOk);
  EXPECT_FALSE(back.joints[0].has(JointField::kC));
  EXPECT_TRUE(back.joints[0].has(JointField::kD));
}

TEST(Tables, refuse_what_cannot_be_deployed) {
  const auto code_of = [](const Params& params) -> std::string {
    try {
      (void)make_tables(params);
      return "accepted";
    } catch (const Error& error) {
      EXPECT_EQ(error.place().file, "params.toml");
      return error.code();
    }
  };
  EXPECT_EQ(code_of(Params{}), "nothing_to_deploy");
  Params params = arm();
  params.sections[0].values[0].unit = "N m";
  EXPECT_EQ(code_of(params), "dimension_wrong");
  params = arm();
  params.sections[0].constants[0].second = -0.019;
  EXPECT_EQ(code_of(params), "value_out_of_range");
  params = arm();
  params.sections.push_back(params.sections[0]);
  EXPECT_EQ(code_of(params), "too_many_joints");
  params = arm();
  params.sections.back().constants[0].second = 7;
  EXPECT_EQ(code_of(params), "value_out_of_range");
}

TEST(Tables, csv_reads_back_to_the_same_values) {
  const Folder folder;
  const Params params = arm();
  const models::ParameterTable table = parameter_table(params);
  const auto paths = write_tables(params, folder.path / "arm");
  ASSERT_EQ(paths.size(), 5u);
  for (const auto& path : paths) EXPECT_TRUE(std::filesystem::exists(path)) << path;

  const ReadOptions options{.map = {}, .require_time = false, .hash = false};
  const series::Recording actuators = read_recording(folder.path / "arm_actuator.csv", options);
  const series::Recording control = read_recording(folder.path / "arm_control.csv", options);
  ASSERT_EQ(actuators.rows(), 6u);
  ASSERT_EQ(control.rows(), 6u);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(actuators.column("A").values[i], table.joints[i][JointField::kA]);
    const double B = table.joints[i][JointField::kB];
    EXPECT_NEAR(actuators.column("B").values[i], B,
                4e-16 * B);  // the factor to SI is applied once on each way
    EXPECT_EQ(actuators.column("C").values[i], table.joints[i][JointField::kC]);
    EXPECT_EQ(actuators.column("D").values[i], table.joints[i][JointField::kD]);
    EXPECT_EQ(actuators.column("chain_wheel_diameter").values[i],
              2 * table.joints[i][JointField::kWheelRadius]);
    EXPECT_EQ(actuators.column("A_std_error").values[i], 0.01);
    EXPECT_EQ(control.column("K_P_position").values[i], table.joints[i][JointField::kPositionP]);
    EXPECT_EQ(control.column("K_I_torque").values[i], table.joints[i][JointField::kTorqueI]);
  }
}

TEST(Tables, csv_shows_the_digits_of_table_6_1) {
  const std::string csv = make_tables(arm()).actuator_csv;
  EXPECT_NE(csv.find("joint [-],A [N/m],B [N cm2/kg],C [N m s3],D [N m s],chain_wheel_diameter [m]"),
            std::string::npos);
  EXPECT_NE(csv.find("\n1,-143000.0,3200.0,0.0351,2.2,0.03,"), std::string::npos) << csv;
  EXPECT_NE(csv.find("\n6,-37600.0,134.0,0.0023,0.143,0.015,"), std::string::npos) << csv;
}

TEST(Tables, markdown_shows_tables_6_1_and_6_2) {
  const std::string text = make_tables(arm()).markdown;
  EXPECT_NE(text.find("| 2 | -108000 ± 0.01 | 970 ± 0.01 | 0.0184 ± 0.01 | 1.14 ± 0.01 | 0.025 |"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("| 1 | 200 | 80 | 0.0065 | 10 |"), std::string::npos) << text;
  EXPECT_NE(text.find("| 1.75 | 0.45 | 0.14 |"), std::string::npos) << text;
}

TEST(Tables, a_label_cannot_break_out_of_a_comment) {
  Params params = arm();
  params.sections[0].label = params.sections[1].label = "*/ #error \\\n|";
  const Folder folder;
  write(folder.path / "t.h", make_tables(params, "a*/b.toml").header);
  const Outcome result = run("cc -std=c11 -Wall -Wextra -Wpedantic -Werror -x c -fsyntax-only " +
                             (folder.path / "t.h").string());
  EXPECT_EQ(result.code, 0) << result.output;
}

class Header : public testing::Test {
 protected:
  void SetUp() override {
    write(folder.path / "isac_parameters.h", make_tables(arm()).header);
    write(folder.path / "user.c",
          "#include \"isac_parameters.h\"\ndouble first(void) { return isac_joints[0].A; }\n");
    write(folder.path / "user.cpp",
          "#include \"isac_parameters.h\"\ndouble first();\ndouble first() { return isac_joints[0].A; }\n");
  }
  void expect_compiles(const std::string& compiler, const char* file) {
    const Outcome result = run(compiler + " -Wall -Wextra -Wpedantic -Werror -Wconversion -c " +
                               (folder.path / file).string() + " -o " + (folder.path / "out.o").string());
    EXPECT_EQ(result.code, 0) << result.output;
  }
  Folder folder;
};

TEST_F(Header, compiles_as_c11_and_as_cpp20_with_every_warning_an_error) {
  write(folder.path / "user.c",
        "#include \"isac_parameters.h\"\ndouble first(void);\ndouble first(void) { return isac_joints[0].A; "
        "}\n");
  expect_compiles("cc -std=c11 -Wshadow -Wmissing-prototypes", "user.c");
  expect_compiles("c++ -std=c++20 -Wshadow -Wold-style-cast", "user.cpp");
  expect_compiles("cc -std=c11 -x c", "isac_parameters.h");
}

TEST_F(Header, compiles_for_a_cortex_m4) {
  if (!have("arm-none-eabi-gcc"))
    GTEST_SKIP() << "arm-none-eabi-gcc is not installed, so the header is not tried for a Cortex-M4.";
  expect_compiles("arm-none-eabi-gcc -std=c11 -mcpu=cortex-m4 -mthumb -ffreestanding", "user.c");
}

TEST_F(Header, loader_of_the_binary_needs_no_library_on_a_cortex_m4) {
  if (!have("arm-none-eabi-g++")) {
    GTEST_SKIP() << "arm-none-eabi-g++ is not installed, so the loader is not tried for a Cortex-M4.";
  }
  write(folder.path / "load.cpp",
        "#include \"isac/models/parameter_table.hpp\"\nisac::Status load(std::span<const std::byte> bytes, "
        "isac::models::ParameterTable& table);\nisac::Status load(std::span<const std::byte> bytes, "
        "isac::models::ParameterTable& table) {\n  return isac::models::load_parameter_table(bytes, "
        "table);\n}\n");
  expect_compiles(
      "arm-none-eabi-g++ -std=c++20 -O2 -mcpu=cortex-m4 -mthumb -fno-exceptions -fno-rtti -I" ISAC_SOURCE_DIR
      "/src",
      "load.cpp");
  std::istringstream symbols(run("arm-none-eabi-nm -u " + (folder.path / "out.o").string()).output);
  for (std::string kind, name; symbols >> kind >> name;) {
    EXPECT_TRUE(name.starts_with("__aeabi_") || name == "memcpy" || name == "memset") << name;
  }
}

TEST_F(Header, holds_the_bits_of_the_binary) {
  const DeploymentTables tables = make_tables(arm());
  write(
      folder.path / "print.c",
      "#include <stdio.h>\n#include \"isac_parameters.h\"\nint main(void) {\n"
      "  for (int i = 0; i < ISAC_PARAMETERS_JOINTS; ++i) {\n    const double *value = &isac_joints[i].A;\n"
      "    printf(\"%lu\\n\", (unsigned long)isac_joints[i].present);\n"
      "    for (int k = 0; k < 22; ++k) printf(\"%.17g\\n\", value[k]);\n  }\n"
      "  printf(\"%.17g\\n%lu\\n\", isac_effects[0].parameters[0], (unsigned long)isac_effects[0].id_hash);\n"
      "  printf(\"%.17g %.17g %.17g\\n\", isac_masses[0], isac_masses[1], isac_masses[2]);\n"
      "  printf(\"%lu\\n\", (unsigned long)ISAC_PARAMETERS_CRC32);\n"
      "  for (unsigned i = 0; i < ISAC_PARAMETERS_BYTES; ++i) printf(\"%u\\n\", "
      "isac_parameters_binary[i]);\n  return 0;\n}\n");
  const std::string program = (folder.path / "print").string();
  const Outcome build = run("cc -std=c11 " + (folder.path / "print.c").string() + " -o " + program);
  ASSERT_EQ(build.code, 0) << build.output;
  std::istringstream printed(run(program).output);

  const models::ParameterTable table = parameter_table(arm());
  double value = 0;
  for (int i = 0; i < table.joint_count; ++i) {
    ASSERT_TRUE(printed >> value);
    EXPECT_EQ(value, table.joints[i].present);
    for (const double expected : table.joints[i].value) {
      ASSERT_TRUE(printed >> value);
      EXPECT_EQ(value, expected);
    }
  }
  for (const double expected : {table.effects[0].parameters[0], double(table.effects[0].id_hash),
                                table.masses[0], table.masses[1], table.masses[2]}) {
    ASSERT_TRUE(printed >> value);
    EXPECT_EQ(value, expected);
  }
  ASSERT_TRUE(printed >> value);
  EXPECT_EQ(value, crc32(std::span(tables.binary).first(tables.binary.size() - 4)));
  for (const std::byte expected : tables.binary) {
    ASSERT_TRUE(printed >> value);
    ASSERT_EQ(value, std::to_integer<int>(expected));
  }
}

}  // namespace
}  // namespace isac::record
