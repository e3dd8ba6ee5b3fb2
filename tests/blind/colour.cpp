#include "colour.hpp"

namespace blind {

Colour colour_of(const std::vector<double>& recorded) {
  std::vector<double> means;
  for (std::size_t k = 0; k + kBlock <= recorded.size(); k += kBlock) {
    double sum = 0.0;
    for (std::size_t i = 0; i < kBlock; ++i) sum += recorded[k + i];
    means.push_back(sum / static_cast<double>(kBlock));
  }
  double c[3] = {};
  for (std::size_t lag = 0; lag < 3; ++lag) {
    for (std::size_t k = lag; k < means.size(); ++k) c[lag] += means[k] * means[k - lag];
    c[lag] /= static_cast<double>(means.size());
  }
  Colour colour{c[0], 0.0, 0.0};
  if (c[1] <= 0.0) return colour;
  colour.stay = std::clamp(c[2] / c[1], 0.05, 0.98);
  colour.slow = std::min(c[1] / colour.stay, 0.95 * c[0]);
  colour.white = c[0] - colour.slow;
  // The picture is rough; its size is set so that the recording's own innovations have variance one.
  std::vector<double> innovations = means;
  colour.whiten(innovations, 0);
  double square = 0.0;
  for (const double x : innovations) square += x * x / static_cast<double>(innovations.size());
  colour.white *= square;
  colour.slow *= square;
  return colour;
}

}  // namespace blind
