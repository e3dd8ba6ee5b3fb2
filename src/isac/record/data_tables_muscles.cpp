// Which muscle can serve which joint, asked of the data sheets (seed F.2).
#include <fmt/format.h>

#include <algorithm>

#include "isac/core/units.hpp"
#include "isac/record/data_tables.hpp"

namespace isac::record {
namespace {

constexpr double kRangeOfModel = 2.0 * kPascalPerKgfCm2;  // Pa, seed 3.5
constexpr double kAngleLimit = 3.0 / 8.0 * kPi;           // rad, seed 3.5
constexpr double kLengthTolerance = 0.1;

std::string sentence_of(const MuscleFit& fit, const JointDemand& demand) {
  const char* words = fit.verdict == MuscleFit::Verdict::kServes   ? "serves"
                      : fit.verdict == MuscleFit::Verdict::kPartly ? "serves in part of the torque range"
                                                                   : "is too weak for";
  std::string out = fmt::format("{} {} {} joint {}: {:.0f} N of the {:.0f} N needed", fit.muscle.maker,
                                fit.muscle.type, words, demand.joint, fit.muscle.usable_force, demand.force);
  if (!fit.length_fits) {
    out += fmt::format("; it is {:.0f} mm long where the joint has {:.0f} mm", 1e3 * fit.muscle.length_max,
                       1e3 * demand.muscle_length);
  }
  return out + ".";
}

}  // namespace

std::vector<Muscle> read_muscles(const std::filesystem::path& folder, double usable_share_of_strength) {
  std::vector<Muscle> muscles;
  const DataTable rubber = read_data(folder / "rubbertuators.toml");
  for (std::size_t row = 0; row < rubber.rows.size(); ++row) {
    const double length = rubber.si(row, "effective_length");
    muscles.push_back({"Bridgestone", rubber.text(row, "type"),
                       usable_share_of_strength * rubber.si(row, "strength"), length, length,
                       rubber.si(row, "contraction_max"), rubber.si(row, "pressure_max")});
  }
  const DataTable air = read_data(folder / "air_muscles.toml");
  for (std::size_t row = 0; row < air.rows.size(); ++row) {
    const double length = air.si(row, "length");
    muscles.push_back({"Shadow", air.text(row, "type"), air.si(row, "pull_max"), length, length,
                       air.si(row, "contraction_max"), air.si(row, "pressure_max")});
  }
  const DataTable fluidic = read_data(folder / "fluidic_muscles.toml");
  for (std::size_t row = 0; row < fluidic.rows.size(); ++row) {
    muscles.push_back({"Festo", fluidic.text(row, "type"), fluidic.si(row, "force_max"),
                       fluidic.si(row, "length_min"), fluidic.si(row, "length_max"),
                       fluidic.si(row, "contraction_max"), fluidic.si(row, "pressure_max")});
  }
  return muscles;
}

std::vector<JointDemand> read_joint_demands(const std::filesystem::path& folder) {
  const DataTable places = read_data(folder / "joint_muscles.toml");
  const DataTable actuators = read_data(folder / "actuator_parameters.toml");
  std::vector<JointDemand> demands;
  for (std::size_t row = 0; row < places.rows.size(); ++row) {
    JointDemand demand;
    demand.joint = places.text(row, "joint");
    demand.muscle_length = places.si(row, "muscle_length");
    const std::size_t actuator = actuators.find("joint", demand.joint);
    demand.force = actuators.si(actuator, "B") * kRangeOfModel;  // T = B r Δp = (F2 − F1) r with F1 = 0
    demand.contraction =
        actuators.si(actuator, "chain_wheel_diameter_m") / 2 * kAngleLimit / demand.muscle_length;
    demands.push_back(demand);
  }
  return demands;
}

std::vector<MuscleFit> muscles_for_joint(const JointDemand& demand, const std::vector<Muscle>& muscles) {
  std::vector<MuscleFit> fits;
  for (const Muscle& muscle : muscles) {
    MuscleFit fit;
    fit.muscle = muscle;
    fit.share = muscle.usable_force / demand.force;
    // The pair works about half its contraction and needs the same way in both directions.
    const bool contracts_enough = muscle.contraction_max / 2 >= demand.contraction;
    if (contracts_enough && fit.share >= 0.5) {
      fit.verdict = fit.share >= 1 ? MuscleFit::Verdict::kServes : MuscleFit::Verdict::kPartly;
    }
    fit.length_fits = muscle.length_min <= demand.muscle_length * (1 + kLengthTolerance) &&
                      muscle.length_max >= demand.muscle_length * (1 - kLengthTolerance);
    fit.sentence = sentence_of(fit, demand);
    fits.push_back(std::move(fit));
  }
  for (MuscleFit& fit : fits) {
    const auto better = [&fit](const MuscleFit& other) {
      if (other.muscle.maker != fit.muscle.maker || other.verdict == MuscleFit::Verdict::kTooWeak)
        return false;
      if (other.verdict != fit.verdict) return other.verdict == MuscleFit::Verdict::kServes;
      return fit.verdict == MuscleFit::Verdict::kServes ? other.share < fit.share : other.share > fit.share;
    };
    fit.first_choice = fit.verdict != MuscleFit::Verdict::kTooWeak && std::ranges::none_of(fits, better);
  }
  return fits;
}

}  // namespace isac::record
