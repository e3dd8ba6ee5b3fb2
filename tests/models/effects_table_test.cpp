// docs/effects.md shows the catalogue as it is in the code: the table in the document is this test's.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iomanip>
#include <iterator>
#include <sstream>
#include <string>

#include "isac/models/effects.hpp"

namespace isac::models {
namespace {

const char* name(Subsystem where) {
  switch (where) {
    case Subsystem::kMuscle:
      return "muscle";
    case Subsystem::kJoint:
      return "joint";
    case Subsystem::kPcu:
      return "pcu";
    case Subsystem::kSensor:
      return "sensor";
    case Subsystem::kRig:
      return "rig";
  }
  return "";
}

const char* name(Hook hook) {
  switch (hook) {
    case Hook::kTorque:
      return "torque";
    case Hook::kCommand:
      return "command";
    case Hook::kPressureRate:
      return "pressure rate";
    case Hook::kOutletPressure:
      return "outlet pressure";
    case Hook::kMusclePressure:
      return "muscle pressure";
    case Hook::kReading:
      return "reading";
    case Hook::kDelay:
      return "delay";
    case Hook::kOutlier:
      return "outlier";
  }
  return "";
}

std::string number(double value) {
  if (std::isinf(value)) return "inf";
  std::ostringstream text;
  text << std::setprecision(4) << value;
  return text.str();
}

/// "|" would end a cell.
std::string cell(std::string text) {
  for (std::size_t at = 0; (at = text.find('|', at)) != std::string::npos; at += 2) text.insert(at, "\\");
  return text;
}

std::string table() {
  std::ostringstream out;
  out << "| id | term | where | hook | adds or does | parameters: name [unit] low … high (typical; absent "
         "at) | "
         "states | linear | confused with | told apart by |\n"
         "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n";
  for (const EffectInfo& e : effect_catalogue()) {
    out << "| " << e.id << " | " << e.term << " | " << name(e.where) << " | " << name(e.hook) << " | `"
        << cell(e.equation) << "` | ";
    for (int k = 0; k < e.parameter_count; ++k) {
      const ParameterInfo& p = e.parameters[k];
      out << (k > 0 ? "; " : "") << p.name << " [" << p.unit << "] " << number(p.lower / p.si_per_unit)
          << " … " << number(p.upper / p.si_per_unit) << " (" << number(p.typical / p.si_per_unit);
      if (!std::isnan(p.null_value)) out << "; " << number(p.null_value / p.si_per_unit);
      out << ")";
    }
    out << " | " << e.state_count << " | " << (e.linear ? "yes" : "no") << " | " << e.confused_with << " | "
        << e.told_apart_by << " |\n";
  }
  return out.str();
}

TEST(EffectsDocument, shows_the_catalogue_of_the_code) {
  std::ifstream in(ISAC_SOURCE_DIR "/docs/effects.md");
  const std::string document((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const std::string begin = "<!-- catalogue: begin -->\n", end = "<!-- catalogue: end -->\n";
  const auto from = document.find(begin), to = document.find(end);
  ASSERT_NE(from, std::string::npos) << "docs/effects.md has lost its markers";
  ASSERT_NE(to, std::string::npos) << "docs/effects.md has lost its markers";
  if (document.substr(from + begin.size(), to - from - begin.size()) != table()) {
    std::ofstream("effects_table.md") << table();
    FAIL() << "put the file effects_table.md, just written here, between the markers of docs/effects.md";
  }
}

}  // namespace
}  // namespace isac::models
