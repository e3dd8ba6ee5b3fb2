#include "isac/explain/gate.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace isac::explain {
namespace {

constexpr double kFarBelow = 50;  // times below the level a p-value leaves no doubt

/// Of each chain: what turns √Σ x², x in units of σ, into noise floors; 0 where the chain has no rows.
std::array<double, kChains> floors_per_root_sum(const Prepared& data, const Weights& weights,
                                                const Floors& floors) {
  std::array<double, kChains> rows{}, scale{};
  for (const Row& row : data.rows) ++rows[static_cast<std::size_t>(row.chain)];
  for (std::size_t c = 0; c < kChains; ++c) {
    const double sigma = weights.sigma[c], white = floors.white[c];
    if (rows[c] > 0)
      scale[c] = sigma / (std::isfinite(white) && white > sigma ? white : sigma) / std::sqrt(rows[c]);
  }
  return scale;
}

}  // namespace

bool is_significant(const Screened& c, const Screen& s) noexcept {
  return c.T >= s.limit || c.rare_p <= s.rare_limit;
}

Gate Gatekeeper::judge(const Screen& s, const Weights& weights, const Floors& floors, bool beside_effects,
                       const std::set<std::string>& ignored) const {
  Gate gate;
  gate.p_value = joint_p(s.p_value, s.rare_p, significance_);
  gate.significant = gate.p_value <= significance_;
  gate.beyond_doubt = gate.significant && (gate.p_value <= significance_ / kFarBelow ||
                                           s.max_T * s.max_T >= s.limit * s.limit + 2 * std::log(kFarBelow));
  const std::array<double, kChains> scale = floors_per_root_sum(data_, weights, floors);
  const auto consider = [&](double amplitude2, const double* norm2, const std::string& what, bool dense) {
    for (std::size_t c = 0; c < kChains; ++c) {
      const double size = norm2[c] > 0 ? std::sqrt(amplitude2 * norm2[c]) * scale[c] : 0.0;
      if (dense) gate.dense_size = std::max(gate.dense_size, size);
      if (size <= gate.size) continue;
      gate.size = size;
      gate.chain = static_cast<Chain>(c);
      gate.what = what;
    }
  };
  // The first effect's own size is told by its refit; what is left beside one casts doubt already by its linear response.
  for (const Screened& c : s.candidates) {
    if (!(c.gain > 0) || !is_significant(c, s)) continue;
    const std::string id = library_.hypotheses[static_cast<std::size_t>(c.hypothesis)].id();
    if (ignored.count(id) == 0) consider(1.0, c.chain_norm2, id, beside_effects && c.T >= s.limit);
  }
  for (const Column& c : s.columns)
    if (c.hypothesis < 0 && c.norm2 > 0 && c.T >= s.limit)
      consider(c.score * c.score / (c.norm2 * c.norm2), c.plain_norm2, c.name, true);
  gate.material = gate.size >= material_;
  return gate;
}

Gatekeeper::Sized Gatekeeper::most_significant(const Screen& s, const Weights& weights,
                                               const Floors& floors) const {
  Sized found;
  const Column* most = nullptr;
  for (const Column& c : s.columns)
    if (c.norm2 > 0 && (most == nullptr || c.T > most->T)) most = &c;
  if (most == nullptr) return found;
  const std::array<double, kChains> scale = floors_per_root_sum(data_, weights, floors);
  for (std::size_t c = 0; c < kChains; ++c) {
    const double size = std::abs(most->score) / most->norm2 * std::sqrt(most->plain_norm2[c]) * scale[c];
    if (size > found.size) found = {size, static_cast<Chain>(c)};
  }
  return found;
}

}  // namespace isac::explain
