// Muscle models on the isometric records of a 10 mm Festo muscle: trained on the 10 cm muscle, judged on the 20 cm one.
#include <gtest/gtest.h>

#include <cmath>

#include "isac/estimate/muscle_fit.hpp"
#include "real_columns.hpp"

namespace isac::estimate {
namespace {

// Unloaded readings of each test, from the recordings' index (N).
double recorded_zero(int length, int part) {
  const double ten[] = {3.56, -3.2708, -3.9538, -8.7354}, twenty[] = {13.806, -8.7354, -8.0523, -6.0031};
  return length == 10 ? ten[part / 25] : twenty[part / 25];
}

std::vector<MuscleRun> load(int length) {
  std::vector<MuscleRun> runs;
  for (const int part : {0, 25, 50, 75}) {
    MuscleRun run;
    run.name = "festo10_L" + std::to_string(length) + "cm_kink" + std::to_string(part);
    const auto c = test::read_columns(test::real_data() + "/festo10_isometric/" + run.name + ".csv");
    if (c.size() < 8) continue;
    run.time = c[0];
    for (double p : c[1]) run.pressure.push_back(1e3 * p);
    run.force = c[2];
    for (double v : c[3]) run.filling.push_back(v < 1.5 ? 1.0 : 0.0);
    run.contraction = c[6];
    run.rest_length = c[5][0];
    if (part > 0) run.full_contraction = c[6][0] / c[7][0];
    run.force_zero = recorded_zero(length, part);
    runs.push_back(run);
  }
  return runs;
}

// The lab's own law, fitted by it to muscles of all lengths (m, kPa, N); pressures as read.
double lab_law(double pressure, double contraction, const MuscleRun& run) {
  const double p = 1e-3 * pressure;
  const double full = run.rest_length < 0.1 ? 0.156627 : 0.164835;  // contraction that the index calls 1
  const double e = contraction / full;
  const double most = 0.4864 * 620 * std::atan(0.03306 * (run.rest_length - 0.0075) * 620);
  return most * (0.5682 * (std::exp(-4.254 * e) - 1) + p / 620 * std::exp(-0.5597 * e * e));
}

double pooled(const std::vector<MuscleRunResult>& runs) {
  double sum = 0, n = 0;
  for (const MuscleRunResult& r : runs) {
    sum += r.rmse * r.rmse * static_cast<double>(r.samples);
    n += static_cast<double>(r.samples);
  }
  return std::sqrt(sum / n);
}

class MuscleReal : public ::testing::Test {
 protected:
  void SetUp() override {
    if (test::real_data().empty())
      GTEST_SKIP() << "set ISAC_REAL_DATA to the folder with real recordings to run this test";
    train = load(10);
    heldout = load(20);
    ASSERT_EQ(train.size() + heldout.size(), 8u);
    // Lengths (not forces) of the four muscles of this make: rest 8.3, 18.2, 28.1, 38.2 cm, at 620 kPa 7.0, 15.2, 23.2, 31.4 cm.
    four_lengths = {{0.083, 1.3 / 8.3}, {0.182, 3.0 / 18.2}, {0.281, 4.9 / 28.1}, {0.382, 6.8 / 38.2}};
  }
  static MuscleFitOptions options(ZeroHandling zero, const std::vector<MuscleLength>& lengths) {
    MuscleFitOptions o;
    o.zero = zero;
    o.known_muscles = lengths;
    return o;
  }
  double report(const char* title, const MuscleFitOptions& options) {
    const MuscleFit fit = fit_muscle(train, heldout, options);
    const double law = pooled(score_muscle_law(heldout, lab_law, options));
    std::printf("%s: end length %.2f mm, the lab's law %.2f N on the 20 cm records\n", title,
                1e3 * fit.end_length, law);
    for (const MuscleModelResult& m : fit.ranking) {
      std::printf("  %-30s trained %6.2f N, held out %6.2f N, AIC %7.1f, by record:", m.name.c_str(),
                  m.train_rmse, m.heldout_rmse, m.aic);
      for (const MuscleRunResult& r : m.runs) std::printf(" %.1f", r.rmse);
      std::printf("\n");
    }
    std::printf("  %-30s by record:", "the lab's law");
    for (const auto* set : {&train, &heldout})
      for (const MuscleRunResult& r : score_muscle_law(*set, lab_law, options)) std::printf(" %.1f", r.rmse);
    std::printf("\n");
    for (const HysteresisWidth& h : fit.hysteresis)
      std::printf("  hysteresis %s: mean %.1f N, worst %.1f N at %.0f kPa\n", h.run.c_str(), h.mean, h.worst,
                  1e-3 * h.at_pressure);
    return fit.ranking.front().heldout_rmse / law;
  }
  std::vector<MuscleRun> train, heldout;
  std::vector<MuscleLength> four_lengths;
};

TEST_F(MuscleReal, best_model_beats_the_labs_law_with_the_recorded_zero) {
  EXPECT_LT(report("recorded zero, lengths of two muscles", {}), 1.0);
}

TEST_F(MuscleReal, best_model_beats_the_labs_law_on_readings_as_they_stand) {
  EXPECT_LT(report("no zero, lengths of four muscles", options(ZeroHandling::kNone, four_lengths)), 1.0);
}

TEST_F(MuscleReal, best_model_beats_the_labs_law_with_the_recorded_zero_and_four_lengths) {
  EXPECT_LT(report("recorded zero, lengths of four muscles", options(ZeroHandling::kRecorded, four_lengths)),
            1.0);
}

// Said as it is: once every record may choose its own zero, the law that was fitted to all lengths is the better one.
TEST_F(MuscleReal, labs_law_stays_ahead_when_every_record_chooses_its_zero) {
  EXPECT_GT(report("fitted zero, lengths of four muscles", options(ZeroHandling::kFitted, four_lengths)),
            1.0);
}

}  // namespace
}  // namespace isac::estimate
