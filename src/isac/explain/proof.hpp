/// @file
/// The proof: the gap before and after on runs that no fit, test or choice has seen, against the noise floor and the model
/// that says nothing moves.
///
/// They may take away a name and say in which reading the gap is told (doubt.hpp, explain.cpp), and choose when an encoder slipped, or that it did,
/// where fitted runs cannot tell (slip_moment.hpp); the answer says so. Decision 0171.
/// This is the only place that opens HeldOut. Parameters stay as they were fitted. Residuals are at the recording's rate, raw.
/// Units: the signal's. Threads: pure. Errors: none; runs that cannot be compared are left out.
/// Source: docs/derivations/explain.md.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "isac/explain/compare.hpp"
#include "isac/explain/explanation.hpp"
#include "isac/explain/fit.hpp"
#include "isac/explain/quiet_pressure.hpp"
#include "isac/explain/screen.hpp"
#include "isac/explain/spectrum.hpp"

namespace isac::explain {

/// Sums of squares of one signal over runs, at the recording's rate.
struct Sums {
  double squares = 0, signal_squares = 0;
  std::size_t samples = 0;
  [[nodiscard]] double rms() const;
  [[nodiscard]] double signal_rms() const;
};

/// rms of weighted rows of one chain, in its unit.
[[nodiscard]] double weighted_rms(const Prepared& data, const Weights& weights, const Eigen::VectorXd& rows,
                                  Chain chain);

/// rms of the raw residual of one chain over all runs of a dataset.
[[nodiscard]] Sums raw_residual(const Predictor& predictor, const ModelPoint& model, Chain chain);

/// Columns for the pictures.
[[nodiscard]] std::vector<RunTrace> traces_of(const Predictor& predictor, const ModelPoint& before,
                                              const ModelPoint& after, Chain chain, bool heldout,
                                              std::size_t most_points);

class Proof {
 public:
  /// Held-out runs prepared with the rig and baseline of the fitted ones; empty if none can be used.
  Proof(const HeldOut& heldout, const Prepared& fitted, const QuietPressure& quiet = {});
  [[nodiscard]] std::size_t runs() const noexcept { return count_; }
  /// s of the day, of each run that can be compared.
  struct Span {
    double begin = 0, end = 0;
  };
  [[nodiscard]] std::vector<Span> spans() const;
  [[nodiscard]] Sums residual(const ModelPoint& model, Chain chain) const;
  /// Two models in rows freed of what the noise remembers (weights.hpp).
  struct Freed {
    Comparison behind;             ///< of the second, behind the first; all chains
    double first = 0, second = 0;  ///< rms in the chain, its unit
  };
  [[nodiscard]] Freed freed(const ModelPoint& first, const ModelPoint& second, const Weights& weights,
                            Chain chain) const;
  /// Of what the model leaves here (unknown.hpp); empty: no signal tells it.
  [[nodiscard]] std::string signal_that_tells(const ModelPoint& model, const Weights& weights,
                                              Chain chain) const;
  /// What functions of the signals score in these runs beside the model. Its parameters' slopes are projected off, as in a screen of fitted runs:
  /// one that is a little off for these leaves nothing.
  struct Screened {
    const Prepared* data = nullptr;  ///< none: no run can be compared
    Screen screen;
  };
  [[nodiscard]] Screened screened(const Fit& fit, const Weights& weights, const Library& library,
                                  const ScreenOptions& options) const;
  /// measured − predicted of each run, for what shows at the recording's rate only.
  [[nodiscard]] std::vector<Series> series(const ModelPoint& model, Chain chain) const;
  [[nodiscard]] std::vector<RunTrace> traces(const ModelPoint& before, const ModelPoint& after, Chain chain,
                                             std::size_t most_points) const;

 private:
  /// The model without what belongs to the fitted runs alone.
  [[nodiscard]] ModelPoint moved_here(const ModelPoint& model) const;
  /// Of all rows; 0 where nothing is predicted.
  [[nodiscard]] Eigen::VectorXd weighted_residual(const ModelPoint& model, const Weights& weights) const;

  std::optional<Prepared> data_;
  std::optional<Predictor> predictor_;
  std::size_t count_ = 0;
};

}  // namespace isac::explain
