/// @file
/// Figures of the report of isac-explain. Internal to the report room.
///
/// A figure without data comes back empty, and a document leaves it out. Units: the traces'. Threads: pure.
#pragma once

#include <string>
#include <vector>

#include "isac/explain/explanation.hpp"
#include "isac/report/figure.hpp"

namespace isac::report {

/// rms after each effect, fitted and held out, over the noise floor.
[[nodiscard]] Figure waterfall_figure(const explain::Explanation& e);
/// Measured, simulated before and after; below, what both leave over. Held-out runs first.
[[nodiscard]] std::vector<Figure> run_figures(const explain::Explanation& e, std::size_t most);
/// Mean residual over speed, angle and both pressures, before and after.
[[nodiscard]] Figure profile_figure(const explain::Explanation& e, const std::string& signal,
                                    const std::string& position_unit = "rad");
/// Mean residual over speed and angle, and over Δp and angle, before and after.
[[nodiscard]] Figure map_figure(const explain::Explanation& e, const std::string& signal,
                                const std::string& position_unit = "rad");
/// The shape of what has no name.
[[nodiscard]] Figure unknown_figure(const explain::Explanation& e);

/// Signals of the traces, the gap's own first.
[[nodiscard]] std::vector<std::string> signals_of(const explain::Explanation& e);

}  // namespace isac::report
