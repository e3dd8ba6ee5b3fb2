// Values at which an effect is not what its name says, each beside one at which it is.
#include "isac/explain/plausible.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string_view>

#include "tied_data.hpp"

namespace isac::explain {
namespace {

/// A joint that is moved over ± 0.5 rad before an encoder of 8000 steps.
struct Setting {
  Prepared data;
  Library library;
  Setting() {
    const test::TiedRig rig;
    const PlannedRun free{.experiment = "free",
                          .seconds = 16,
                          .mean_pressure_kgcm2 = 3,
                          .pressure_swing_kgcm2 = 0.8,
                          .pressure_period_s = 4,
                          .waveform = "steps"};
    data = prepare(test::record_all(rig, {test::by_hand(20, 0.5, 1.0), free}), rig.facts(), {}, 4.0);
    library = make_library(data);
  }
  std::string objection(std::string_view form, std::initializer_list<double> values) const {
    for (const Hypothesis& h : library.hypotheses) {
      if (form != h.info().id) continue;
      Values v{};
      std::copy(values.begin(), values.end(), v.begin());
      return Plausible(data).objection(h, v);
    }
    ADD_FAILURE() << form;
    return {};
  }
};

struct Case {
  const char* form;
  std::initializer_list<double> ordinary, wrong;
};

TEST(Plausible, objects_to_what_is_not_what_its_name_says_and_to_nothing_else) {
  const Setting setting;
  const Case cases[] = {
      {"stribeck_friction", {0.02, 0.03, 0.1}, {0.02, 0.015, 0.1}},    // less at rest
      {"stribeck_friction", {0.02, 0.03, 0.05}, {0.02, 0.03, 0.02}},   // below 2 steps in 50 ms: 0.031 rad/s
      {"stribeck_friction", {0.02, 0.022, 0.1}, {0.02, 0.0205, 0.1}},  // no more at rest
      {"pressure_dependent_friction", {0.02, 1.0}, {0.02, 0.03}},
      {"hysteresis", {0.02, 0.05}, {0.02, 0.001}},
      {"hysteresis", {0.02, 0.1}, {0.02, 1.5}},
      {"hysteresis", {0.02, 0.2}, {0.02, 0.4}},  // of 1 rad in all
      {"maxwell_slip", {0.02, 0.1}, {0.02, 0.4}},
      {"asymmetric_hysteresis", {0.02, 0.03, 0.05, 0.05}, {0.02, 0.03, 0.05, 0.4}},
      {"asymmetric_hysteresis", {0.02, 0.03, 0.05, 0.05}, {0.02, 0.022, 0.05, 0.048}},
      {"asymmetric_hysteresis", {0.02, 0.02, 0.05, 0.1}, {0.02, 0.02, 0.05, 0.05}},
      {"end_stop", {50, 0.35, -3.0}, {0.04, 0.05, 0.0}},
      {"torque_ripple", {0.02, 0.01, 16}, {0.02, 0.01, 8}},
      {"creep", {0.2, 5}, {0.2, 1.0}},
      {"torque_ripple", {9.0, 0.01, 16}, {10.0, 0.01, 16}},  // an amplitude at its end
  };
  for (const Case& c : cases) {
    EXPECT_EQ(setting.objection(c.form, c.ordinary), "") << c.form;
    EXPECT_NE(setting.objection(c.form, c.wrong), "") << c.form;
  }
}

}  // namespace
}  // namespace isac::explain
