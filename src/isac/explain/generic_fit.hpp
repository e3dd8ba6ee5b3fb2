/// @file
/// What functions of the measured signals without a name make of a residual: the shape of an unknown effect, and the rival that a named one
/// must not lose to.
///
///   r = r₀ + Σ a_k g_k + H d,   g_k one after another, whichever takes most, of one chain; each projected off the fitted parameters and
///   off those before it; H d: tolerances that come back beside them (refine.hpp)
///
/// Taken are at most three, each at least a tenth of the first's gain and 12 units of noise, among those whose T is 0.7 of the limit.
/// As a name's rival they are chosen with the tolerances come back, and one of the torque or of the motion may be of what the force sensors
/// read, which both are held against.
/// Threads: safe on separate arguments. Errors: none (nothing taken where nothing stands out). Source: docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "isac/explain/compare.hpp"
#include "isac/explain/screen.hpp"

namespace isac::explain {

/// What the best of many takes more than one that was asked for, in parameters: the best of fifty 2 ln 50 units of noise.
inline constexpr int kChoosingOne = 4;

struct GenericFit {
  Chain chain = Chain::kTorque;
  std::vector<std::size_t> functions;  ///< of the dictionary, in the order taken
  std::vector<bool> of_reading;        ///< of each: in torque and motion alike
  double gain = 0;                     ///< Σ of what they took from ‖r₀‖²
  Eigen::VectorXd residual;            ///< r
};

/// A function's rows, weighted and projected off what was fitted.
struct GenericRows {
  std::size_t function = 0;  ///< of the dictionary
  Eigen::VectorXd rows;
  bool of_reading = false;  ///< in torque and motion alike
};
/// Functions of one chain, its best first, that stand out in a screen: what enters the selection.
struct StandingOut {
  Chain chain = Chain::kTorque;
  std::vector<GenericRows> functions;
};

/// `screen`: of the same place, with its dictionary.
[[nodiscard]] StandingOut standing_out(const Around& place, const Screen& screen, int threads = 1);
[[nodiscard]] GenericFit fit_generic(const Around& place, const StandingOut& among, double noise_unit);
[[nodiscard]] GenericFit fit_generic(const Around& place, const Screen& screen, int threads = 1);
/// What a name is held against.
[[nodiscard]] GenericFit rival_without_a_name(const Around& place, const Screen& screen, int threads = 1);
/// "torque: day, force reading: sgn".
[[nodiscard]] std::string names_of(const GenericFit& generic, const Prepared& data);

/// How far a named effect's residual is behind that of nameless functions (t > 0), each counted as the one of many that was looked for.
[[nodiscard]] Comparison behind_generic(const Prepared& data, const Eigen::VectorXd& named,
                                        int named_parameters, const GenericFit& generic);

}  // namespace isac::explain
