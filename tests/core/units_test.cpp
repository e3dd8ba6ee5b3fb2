#include "isac/core/units.hpp"

#include <gtest/gtest.h>

#include <random>
#include <string>

namespace {

using isac::Dimension;
using isac::parse_unit;
namespace dim = isac::dimension;

double scale(std::string_view text) {
  const auto unit = parse_unit(text);
  EXPECT_TRUE(unit.has_value()) << text;
  return unit ? unit->scale : 0.0;
}

Dimension dimension_of(std::string_view text) {
  const auto unit = parse_unit(text);
  EXPECT_TRUE(unit.has_value()) << text;
  return unit ? unit->dimension : Dimension{.count = 99};
}

TEST(Units, knows_every_unit_of_the_recording_format_with_its_exact_factor) {
  struct Row {
    const char* text;
    Dimension dimension;
    double scale;
  };
  const Dimension voltage{.length = 2, .mass = 1, .time = -3, .current = -1};
  const Row rows[] = {{"s", dim::kTime, 1},
                      {"ms", dim::kTime, 1e-3},
                      {"us", dim::kTime, 1e-6},
                      {"min", dim::kTime, 60},
                      {"h", dim::kTime, 3600},
                      {"Hz", {.time = -1}, 1},
                      {"rad", dim::kAngle, 1},
                      {"deg", dim::kAngle, 0.017453292519943295},
                      {"turn", dim::kAngle, 6.283185307179586},
                      {"count", dim::kCount, 1},
                      {"rad/s", dim::kAngularVelocity, 1},
                      {"deg/s", dim::kAngularVelocity, 0.017453292519943295},
                      {"rpm", dim::kAngularVelocity, 0.10471975511965977},
                      {"Pa", dim::kPressure, 1},
                      {"kPa", dim::kPressure, 1e3},
                      {"MPa", dim::kPressure, 1e6},
                      {"bar", dim::kPressure, 1e5},
                      {"mbar", dim::kPressure, 1e2},
                      {"psi", dim::kPressure, 6894.757293168362},
                      {"atm", dim::kPressure, 101325},
                      {"kg/cm2", dim::kPressure, 98066.5},
                      {"kgf/cm2", dim::kPressure, 98066.5},
                      {"N", dim::kForce, 1},
                      {"kN", dim::kForce, 1e3},
                      {"kgf", dim::kForce, 9.80665},
                      {"lbf", dim::kForce, 4.4482216152605},
                      {"N m", dim::kTorque, 1},
                      {"Nm", dim::kTorque, 1},
                      {"N*m", dim::kTorque, 1},
                      {"kgf cm", dim::kTorque, 0.0980665},
                      {"m/s", {.length = 1, .time = -1}, 1},
                      {"m/s2", {.length = 1, .time = -2}, 1},
                      {"mm", dim::kLength, 1e-3},
                      {"cm", dim::kLength, 1e-2},
                      {"m", dim::kLength, 1},
                      {"in", dim::kLength, 0.0254},
                      {"kg", dim::kMass, 1},
                      {"g", dim::kMass, 1e-3},
                      {"kg m2", dim::kInertia, 1},
                      {"A", dim::kCurrent, 1},
                      {"mA", dim::kCurrent, 1e-3},
                      {"V", voltage, 1},
                      {"mV", voltage, 1e-3},
                      {"K", dim::kTemperature, 1},
                      {"1", dim::kNone, 1},
                      {"-", dim::kNone, 1},
                      {"%", dim::kNone, 1e-2}};
  for (const Row& row : rows) {
    EXPECT_EQ(dimension_of(row.text), row.dimension) << row.text;
    EXPECT_EQ(scale(row.text), row.scale) << row.text;  // the nearest double, hence equality
  }
}

TEST(Units, reads_the_seeds_force_kilogram_where_kg_stands_against_cm2) {
  EXPECT_EQ(scale("kg/cm2"), isac::kPascalPerKgfCm2);
  EXPECT_EQ(scale("kgf"), isac::kNewtonPerKgf);
  // B = 174.2 N cm²/kg is newton per kgf/cm2, in SI an area.
  EXPECT_EQ(scale("N cm2/kg"), 1.0 / 98066.5);
  EXPECT_EQ(scale("N cm2/kgf"), 1.0 / 98066.5);
  EXPECT_EQ(scale("N cm²/kg"), 1.0 / 98066.5);
  EXPECT_EQ(dimension_of("N cm2/kg"), (Dimension{.length = 2}));
  // Elsewhere a kilogram is a mass.
  EXPECT_EQ(dimension_of("kg cm2"), dim::kInertia);
  EXPECT_EQ(scale("kg cm2"), 1e-4);
  EXPECT_EQ(dimension_of("kg/m2"), (Dimension{.length = -2, .mass = 1}));
  EXPECT_EQ(dimension_of("N/kg"), (Dimension{.length = 1, .time = -2}));
}

TEST(Units, multiplies_divides_and_raises_as_the_grammar_says) {
  EXPECT_EQ(dimension_of("N m s3"), (Dimension{.length = 2, .mass = 1, .time = 1}));
  EXPECT_EQ(dimension_of("N s/m"), (Dimension{.mass = 1, .time = -1}));
  EXPECT_EQ(dimension_of("kg m^2"), dim::kInertia);
  EXPECT_EQ(dimension_of("kg*m2"), dim::kInertia);
  EXPECT_EQ(dimension_of("kg·m²"), dim::kInertia);
  EXPECT_EQ(dimension_of("  kg   m2  "), dim::kInertia);
  EXPECT_EQ(dimension_of("1/s"), (Dimension{.time = -1}));
  EXPECT_EQ(dimension_of("s-1"), (Dimension{.time = -1}));
  EXPECT_EQ(dimension_of("s^-1"), (Dimension{.time = -1}));
  EXPECT_EQ(dimension_of("N/m s"), dimension_of("N m-1 s-1"));  // everything behind the stroke divides
  EXPECT_EQ(dimension_of("m/s s"), dimension_of("m/s2"));
  EXPECT_EQ(scale("mm2"), 1e-6);
  EXPECT_EQ(scale("kN/mm"), 1e6);
}

TEST(Units, gives_celsius_its_offset_and_only_alone) {
  const auto celsius = parse_unit("degC");
  ASSERT_TRUE(celsius);
  EXPECT_EQ(celsius->offset, 273.15);
  EXPECT_EQ(celsius->scale, 1.0);
  EXPECT_FALSE(parse_unit("degC/s"));
  EXPECT_FALSE(parse_unit("degC2"));
  EXPECT_TRUE(parse_unit("K/s"));
  EXPECT_EQ(parse_unit("K")->offset, 0.0);
}

TEST(Units, keeps_angle_and_count_apart_from_plain_numbers) {
  EXPECT_NE(dimension_of("rad"), dimension_of("-"));
  EXPECT_NE(dimension_of("count"), dimension_of("-"));
  EXPECT_NE(dimension_of("rad/s"), dimension_of("Hz"));
}

TEST(Units, refuses_what_is_not_a_unit) {
  for (const char* text :
       {"",   " ",    "furlong", "Mpa",  "PA",    "n m",  "N//m", "N/m/s", "/s",   "N/",  "N*",
        "*N", "N**m", "m2.5",    "m10",  "m0",    "m^",   "m-",   "m^-",   "--",   "- -", "2",
        "12", "11",   "%%",      "kg.m", "(N m)", "N m)", "[s]",  "s\n",   "N\tm", "°",   "m\xC2",
        "µs", "Nmm",  "m^^2",    "sec",  "mmm",   "kgkg", "2kg",  "1s"}) {
    EXPECT_FALSE(parse_unit(text)) << "'" << text << "'";
  }
  EXPECT_FALSE(parse_unit(std::string_view("s\0", 2)));
  EXPECT_FALSE(parse_unit("V9 V9 V9 V9 V9 V9")) << "s^-162 does not fit the dimension's small integers";
  EXPECT_FALSE(parse_unit("m m m m m m m m m m m m m"));
  EXPECT_FALSE(parse_unit("MPa9 MPa9"));
}

TEST(Units, names_every_si_text_by_a_unit_of_scale_one_and_the_same_dimension) {
  for (const char* text :
       {"-",   "s",    "rad", "rad/s", "rad/s2", "Pa",     "Pa/s",    "N",        "N m", "m",
        "m/s", "m/s2", "m2",  "m3",    "kg",     "kg m2",  "count",   "count/s",  "A",   "V",
        "K",   "1/s",  "N/m", "N s/m", "N m s",  "N m s3", "N m/rad", "N m s/rad"}) {
    const auto unit = parse_unit(text);
    ASSERT_TRUE(unit) << text;
    EXPECT_EQ(unit->scale, 1.0) << text;
    ASSERT_NE(isac::si_unit_text(unit->dimension), nullptr) << text;
    EXPECT_STREQ(isac::si_unit_text(unit->dimension), text);
  }
  EXPECT_EQ(isac::si_unit_text(Dimension{.length = 7}), nullptr);
}

TEST(Units, survives_any_bytes) {
  std::mt19937 random(20031);
  const std::string letters = "smNkgcParadtiunbh/*^-12 ²%VAKC\0\xC2\xB2\xB7";
  std::uniform_int_distribution<std::size_t> length(0, 12);
  std::uniform_int_distribution<std::size_t> pick(0, letters.size() - 1);
  int understood = 0;
  for (int i = 0; i < 200000; ++i) {
    std::string text(length(random), ' ');
    for (char& c : text) c = letters[pick(random)];
    if (const auto unit = parse_unit(text)) {
      ++understood;
      EXPECT_TRUE(unit->scale > 0.0 && unit->scale < 1e61) << text;
    }
  }
  EXPECT_GT(understood, 100) << "the alphabet must reach the inside of the parser";
}

}  // namespace
