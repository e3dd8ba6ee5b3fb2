/// @file
/// Figures drawn by gnuplot (through gnuplot-iostream) as SVG texts that can stand side by side in one HTML file.
///
/// Same figures, same bytes: no clock, no start-up file, no locale enters. One gnuplot process draws all figures of a call.
/// The temporary folder is removed on every way out. Ids inside each SVG begin with the figure's id.
/// Threads: safe from many threads at once. Errors: throws isac::Error "gnuplot_missing" when no gnuplot is on the
/// PATH (with how to install it) and "gnuplot_failed" with gnuplot's own words; usage error for a figure that is_empty().
/// Example: `auto svg = isac::report::render_svg({{figure}});`
#pragma once

#include <span>
#include <string>
#include <vector>

#include "isac/report/figure.hpp"

namespace isac::report {

[[nodiscard]] std::vector<std::string> render_svg(std::span<const Figure> figures);

/// Throws "gnuplot_missing" unless a gnuplot is on the PATH: for programs that would rather know before they compute.
void require_gnuplot();

/// gnuplot's SVG made fit for a place inside HTML: head and empty groups off, ids prefixed, fonts inherited, a title
/// for screen readers. Pure function; exposed for tests.
[[nodiscard]] std::string embeddable_svg(const std::string& gnuplot_svg, const std::string& id,
                                         const std::string& alt);

}  // namespace isac::report
