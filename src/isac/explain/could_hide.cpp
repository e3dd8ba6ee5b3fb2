#include "isac/explain/could_hide.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace isac::explain {
namespace {

constexpr double kOneSided = 1.645;
constexpr double kTestable = 3.0;  // sigma at the typical size

/// The first amplitude of a hypothesis that is free; −1 if there is none.
int first_amplitude(const Hypothesis& h) {
  for (int p = 0; p < h.info().parameter_count; ++p)
    if (h.amplitude[static_cast<std::size_t>(p)] && h.free[static_cast<std::size_t>(p)]) return p;
  return -1;
}

/// Typical sizes are those of the seed's joint. On another rig an effect is asked for at a tenth of what the output holds.
double output_norm(const Prepared& data, const Weights& weights) {
  double squares = 0;
  for (const Row& row : data.rows)
    if (row.chain == Chain::kTorque) {
      const double y = data.runs[row.run].smooth_torque[row.sample];
      squares += y * y;
    }
  return std::sqrt(squares) / weights.sigma[static_cast<int>(Chain::kTorque)];
}

struct Bound {
  double size = 0;        ///< reporting units
  double rows_norm2 = 0;  ///< of the raw response at that size: how much could be there
};

}  // namespace

std::vector<CouldHide> could_hide(const Prepared& data, const Library& library, const Found& found,
                                  std::size_t most) {
  if (found.steps.empty()) return {};
  std::set<std::string> taken;
  for (const std::string& id : not_testable(data, library, found)) taken.insert(id);
  for (const int h : found.added) taken.insert(library.hypotheses[static_cast<std::size_t>(h)].id());
  const Screen& screen = found.steps.back().screen;
  std::map<std::string, Bound> bounds;
  for (const Column& c : screen.columns) {
    if (c.hypothesis < 0 || c.amplitude != 0 || c.norm2 <= 0) continue;
    const Hypothesis& h = library.hypotheses[static_cast<std::size_t>(c.hypothesis)];
    const int p = first_amplitude(h);
    if (p != 0 || taken.count(h.id()) != 0) continue;
    const auto at = static_cast<std::size_t>(p);
    const Values& shape = h.shapes[static_cast<std::size_t>(c.shape)];
    const double null = h.info().parameters[p].null_value;
    if (!std::isfinite(null)) continue;  // a limit that may lie at infinity has no size that could hide
    const double unit = std::max(c.unit, screen.noise_unit);
    const double factor = std::abs(c.score) / c.norm2 + kOneSided * std::sqrt(unit / c.norm2);
    // The least that the data holds against any shape is what could hide in it.
    const double size = factor * std::abs(shape[at] - null) / h.info().parameters[p].si_per_unit;
    const double norm2 = factor * factor * c.raw_norm2;
    Bound& b = bounds[h.id()];
    if (size > b.size) b = {size, norm2};
  }
  std::vector<std::pair<double, CouldHide>> order;
  for (const auto& [id, bound] : bounds) {
    const auto& info = models::effect_catalogue()[static_cast<unsigned>(models::find_effect(id))];
    const double limit = info.parameters[0].upper / info.parameters[0].si_per_unit;
    if (!std::isfinite(bound.size) || bound.size > limit) continue;  // not_testable says so
    order.emplace_back(bound.rows_norm2 / static_cast<double>(data.rows.size()),
                       CouldHide{id, bound.size, info.parameters[0].unit});
  }
  std::stable_sort(order.begin(), order.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  if (order.size() > most) order.resize(most);
  std::vector<CouldHide> out;
  for (auto& [norm2, hidden] : order) out.push_back(std::move(hidden));
  return out;
}

std::vector<std::string> not_testable(const Prepared& data, const Library& library, const Found& found) {
  std::vector<std::string> out = library.not_testable;
  if (found.steps.empty()) return out;
  std::map<std::string, double> reach;
  const double tenth = data.baseline.terms.empty() ? 0.0 : 0.1 * output_norm(data, found.weights);
  for (const Column& c : found.steps.front().screen.columns) {
    if (c.hypothesis < 0) continue;
    const Hypothesis& h = library.hypotheses[static_cast<std::size_t>(c.hypothesis)];
    const std::string id = h.id();
    // Beside the noise of the final model: what is missing from the first is no noise.
    const double unit = found.steps.size() > 1 ? found.steps.back().screen.noise_unit
                                               : std::max(c.unit, found.steps.back().screen.noise_unit);
    const double size =
        tenth > 0 && h.info().linear && c.raw_norm2 > 0 ? tenth / std::sqrt(c.raw_norm2) : 1.0;
    reach[id] = std::max(reach[id], size * std::sqrt(c.norm2 / unit));
  }
  for (const auto& [id, sigma] : reach)
    if (sigma < kTestable) out.push_back(id);
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

}  // namespace isac::explain
