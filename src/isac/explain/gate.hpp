/// @file
/// From a screen to "something is missing, and it matters".
///
///   p = joint_p(p_flips, p_rare)            significant: p ≤ the level of the whole search
///   size = max √(a² Σ x²/n) σ/floor         of all that is significant by itself, a x its linear fit as it is in time, n the chain's rows
///
/// At 10⁵ rows everything is significant; what is material is a share of the noise of one raw sample. Half of that share is asked for where it is beyond
/// doubt that something is there: p fifty times below the level, or T² as far beyond its limit's as a normal T makes fifty times rarer, 2 ln 50. Of
/// 4181 days with nothing hidden 34 had something significant that was smaller than the share; the least p of them was 0.0003.
/// Units: sizes in noise floors. Threads: const. Errors: none. Source: docs/derivations/explain.md.
#pragma once

#include <set>
#include <string>

#include "isac/explain/floors.hpp"
#include "isac/explain/screen.hpp"

namespace isac::explain {

struct Gate {
  bool significant = false, material = false, beyond_doubt = false;
  double p_value = 1;
  double size = 0;  ///< rms of the largest explainable part over the floor, in its best chain
  Chain chain = Chain::kTorque;
  std::string what;  ///< whose response that is
  double dense_size =
      0;  ///< of the largest generic function (beside an effect: response too) that flips of blocks speak for
};

class Gatekeeper {
 public:
  Gatekeeper(const Prepared& data, const Library& library, double significance, double material)
      : data_(data), library_(library), significance_(significance), material_(material) {}

  /// `beside_effects`: effects were added before; `ignored`: ids that do not count.
  [[nodiscard]] Gate judge(const Screen& screen, const Weights& weights, const Floors& floors,
                           bool beside_effects, const std::set<std::string>& ignored) const;
  struct Sized {
    double size = 0;
    Chain chain = Chain::kTorque;  ///< in which it is that large
  };
  /// The response or function with the largest T, significant or not.
  [[nodiscard]] Sized most_significant(const Screen& screen, const Weights& weights,
                                       const Floors& floors) const;

 private:
  const Prepared& data_;
  const Library& library_;
  double significance_, material_;
};

/// By its blocks or, where few carry it, by others.
[[nodiscard]] bool is_significant(const Screened& candidate, const Screen& screen) noexcept;

}  // namespace isac::explain
