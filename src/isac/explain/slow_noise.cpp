#include "isac/explain/slow_noise.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace isac::explain {

SlowRun most_moving_run(const Prepared& data, const Eigen::VectorXd& left) {
  constexpr double kBin = 2.0;  // s
  constexpr std::size_t kFewestSteps = 8, kFewestRuns = 4;
  std::vector<std::pair<double, std::size_t>> moves;  // mean square, run
  for (std::size_t first = 0; first < data.rows.size();) {
    const unsigned of = data.rows[first].run;
    const PreparedRun& run = data.runs[of];
    std::vector<double> sum, count;
    std::size_t i = first;
    for (; i < data.rows.size() && data.rows[i].run == of; ++i) {
      if (data.rows[i].chain != Chain::kTorque || run.is_free) continue;
      const auto bin = static_cast<std::size_t>(run.time[data.rows[i].sample] / kBin);
      if (bin >= sum.size()) sum.resize(bin + 1, 0.0), count.resize(bin + 1, 0.0);
      sum[bin] += left[static_cast<Eigen::Index>(i)];
      ++count[bin];
    }
    first = i;
    const double full = count.empty() ? 0.0 : 0.5 * *std::max_element(count.begin(), count.end());
    double squares = 0;
    std::size_t steps = 0;
    for (std::size_t b = 1; b < sum.size(); ++b) {
      if (count[b] < full || count[b - 1] < full) continue;
      const double step = sum[b] / count[b] - sum[b - 1] / count[b - 1];
      squares += step * step;
      ++steps;
    }
    if (steps >= kFewestSteps) moves.emplace_back(squares / static_cast<double>(steps), of);
  }
  if (moves.size() < kFewestRuns) return {};
  std::sort(moves.begin(), moves.end());
  const double usual = moves[moves.size() / 2].first;
  return {usual > 0 ? moves.back().first / usual : 0.0, std::sqrt(moves.back().first), moves.back().second};
}

}  // namespace isac::explain
