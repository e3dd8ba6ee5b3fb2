#include <array>

#include "isac/report/plotter.hpp"
#include "numbers.hpp"
#include "page.hpp"

namespace blind {

std::string reliability_diagram(const Reliability& names) {
  using namespace isac::report;
  Curve diagonal{
      .label = "as stated", .colour = colour::kReference, .x = {0, 1}, .y = {0, 1}, .dash = Dash::kDashed};
  Curve bars{.label = "right, with 95 %", .mark = Mark::kErrorBars, .colour = colour::kSecond, .size = 5};
  for (const Reliability::Bin& bin : names.bins) {
    const Interval wilson = wilson_interval(bin.right, bin.count);
    bars.x.push_back(bin.stated);
    bars.y.push_back(bin.right / bin.count);
    bars.low.push_back(wilson.low);
    bars.high.push_back(wilson.high);
  }
  Panel panel{.x = {.label = "Confidence stated", .low = 0, .high = 1},
              .y = {.label = "Share right", .low = 0, .high = 1},
              .curves = {diagonal, bars}};
  Figure figure{
      .id = "reliability",
      .alt = "Share of right names over the confidence stated, with intervals, against the diagonal",
      .width = 460,
      .panel_height = 340,
      .panels = {panel}};
  return render_svg(std::array{figure}).front();
}

}  // namespace blind
