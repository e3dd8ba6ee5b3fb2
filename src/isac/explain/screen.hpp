/// @file
/// Is anything missing, and what could it be: scores of every effect's response, freed of what the baseline can mimic.
///
///   x⊥ = x − S (SᵀS)⁻¹ Sᵀ x      response of an effect, less what a change of the fitted parameters does as well
///   g_b = Σ_{i∈b} x⊥_i r_i       score of block b
///   n_b = Σ_{i∈b} x⊥_i r′_i      and with what the fit has taken of its noise (projection.hpp)
///   T = |Σ g_b| / √(Σ n_b²)      and the largest T over all responses, its p-value by flipping the signs of whole blocks
///
/// A flip leaves the distribution of noise as it is, however it is coloured within a block; no noise model enters.
/// T cannot pass the square root of the blocks that carry an effect, because those blocks are their own yardstick. Where they are few
/// (decays of the free joint), the effect's own part is taken out of the scatter first: jackknife over blocks, Student's t. Where they are
/// hardly any (a slip, a stop that is hardly touched), the score is measured by what blocks elsewhere scatter. `rare`: both,
/// Bonferroni over as many columns. What rests within its runs (an offset, a drift of the day) is told from a sensor's zero that moves
/// between runs by its runs alone: where those scatter more than their blocks do, T is Student's of the runs' scatter, as a normal's. Scatter
/// is of what is left beside the column, and beside tolerances that were held at a bound against it: they come back.
/// Where a pressure sensor's noise was taken out of the torque but for each run's mean (quiet_pressure.hpp), the error of that mean is the same
/// in all blocks of its run: e_r = Σ_{i∈r} x⊥_i · B r δp_r is one block more, with nothing in Σ g_b: T = |Σ g_b|/√(Σ n_b² + Σ e_r²). So is that
/// of the valves' lag, by which the noise is known, and of a torque that bends where commands jump, each in all runs (ErrorsOfReading).
/// Threads: uses up to `threads`. Deterministic for a given seed. Errors: none.
/// Source: Hemerik, Goeman and Finos 2020; docs/derivations/explain.md.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "isac/explain/refine.hpp"

namespace isac::explain {

/// What scores scatter in blocks that a column does not live in.
struct Elsewhere {
  double unit = 0;  ///< variance per unit of norm; 0: not measured
  int blocks = 0;   ///< that it was measured in
};

/// One column of evidence: a response, projected.
struct Column {
  static constexpr double kResting =
      0.5;  ///< of Σ x⊥² held by means of runs: the column is as certain as its runs are

  int hypothesis = -1;  ///< index in the library, −1 for the generic dictionary
  int shape = 0, amplitude = 0;
  std::string name;                       ///< of a dictionary column
  Chain chain = Chain::kTorque;           ///< of a dictionary column
  Eigen::VectorXd atom_score, atom_norm;  ///< of the shortest blocks: Σ x⊥ r, Σ x⊥²
  Eigen::VectorXd
      atom_noise;  ///< Σ x⊥ r′, which scatters as noise does (projection.hpp); empty: as atom_score
  Eigen::VectorXd atom_left;  ///< Σ x⊥ r of what is left beside it, of columns that rest; empty else
  /// What errors of one deviation make of its score: of each run, then of the day (ErrorsOfReading).
  Eigen::VectorXd shared_error;
  [[nodiscard]] const Eigen::VectorXd& noise() const noexcept {
    return atom_noise.size() > 0 ? atom_noise : atom_score;
  }
  double score = 0, norm2 = 0;       ///< Σ g_b, Σ x⊥²
  double raw_norm2 = 0;              ///< Σ x²: what was there before the projection
  double chain_norm2[kChains] = {};  ///< Σ x⊥² of each chain
  double plain_norm2[kChains] = {};  ///< the same of x⊥/σ as it is in time, before the noise's filter
  double resting = 0;                ///< share of Σ x⊥² that the means of its runs hold, 0 to 1
  double T = 0;
  double unit = 1;        ///< variance of its score per unit of norm, from the scatter of its blocks
  double carried_by = 0;  ///< blocks, effectively
  double rare_p = 1;      ///< where few blocks carry it, times the columns so tested
  Elsewhere elsewhere;    ///< where hardly any do
};

struct Screened {
  int hypothesis = -1, shape = 0;
  Values start{};     ///< amplitudes as a linear fit would have them
  double gain = 0;    ///< drop of the loss by that linear fit, within the signs that the effect allows
  double T = 0;       ///< largest of its columns
  double rare_p = 1;  ///< smallest of its columns
  double chain_norm2[kChains] = {};  ///< Σ of its response's squares as they are in time, by chain
  double reach =
      0;  ///< sigma that the effect would make at its typical size: below 3 it cannot be tested here
};

struct Screen {
  std::vector<Screened> candidates;  ///< best shape of each hypothesis, largest gain first
  std::vector<Screened> shapes;      ///< every shape of every hypothesis
  std::vector<Column> columns;       ///< all, without their rows
  double max_T = 0;
  double p_value = 1;                      ///< of the largest T, by flips
  double limit = 0;                        ///< T beyond which a column is significant in this whole search
  double rare_p = 1;                       ///< smallest of all columns
  double rare_limit = 0;                   ///< below which a column's is significant in this whole search
  double chain_p[kChains] = {1, 1, 1, 1};  ///< both tests of what shows in that chain alone
  double noise_unit =
      1;  ///< variance of a score per unit of norm, the middle of all columns: 1 for white rows
};

struct ScreenOptions {
  int flips = 1999;
  double significance = 0.01;  ///< of both tests together
  std::uint64_t seed = 1;
  int threads = 2;
  bool dictionary = false;                      ///< the generic functions too
  std::optional<std::set<std::string>> only{};  ///< ids that are looked for; none given: all
};

/// Weighted responses, as one screen of a search computed them and the next may take them again, where they are the same to first order
/// beside whatever was added.
class Responses {
 public:
  void make_room(const Library& library, std::size_t functions);
  /// May a hypothesis' response be kept, or taken, beside this model? A smooth torque's not where forces are read differently, but for a
  /// shift. Dry friction
  /// turns at samples that a tolerance of the angle's clock moves, and an addition moves the tolerances: its response, like a valve's or a
  /// reading's, not where anything was added to its rows. (Coulomb friction's own, kept, stood beside its own sensitivity with T = 3.)
  [[nodiscard]] static bool hold(const Fit& fit, const Hypothesis& hypothesis) noexcept;
  /// Rows × all amplitudes of one part of its shapes; empty: not known yet.
  [[nodiscard]] Eigen::MatrixXf& effect(int hypothesis, std::size_t part) {
    return effects_[static_cast<std::size_t>(hypothesis)][part];
  }
  [[nodiscard]] Eigen::VectorXf& function(std::size_t column) { return functions_[column]; }
  void forget() {
    effects_.clear();
    functions_.clear();
  }

 private:
  std::vector<std::vector<Eigen::MatrixXf>> effects_;
  std::vector<Eigen::VectorXf> functions_;
};

/// `kept`: of the same data, library and weights. `known`: a screen of the same place that was not asked for everything; what it has is taken
/// from there.
[[nodiscard]] Screen screen(const Around& place, const Library& library, const ScreenOptions& options,
                            Responses* kept = nullptr, const Screen* known = nullptr);
/// What the generic functions score beside one hypothesis, refitted. A rare effect that is large bends the whole fit, and what the fit then
/// leaves in other blocks would be its own yardstick after all.
struct Yardstick {
  int hypothesis = -1;
  std::vector<Column> functions;
  double own_p =
      1;  ///< of what its refit closes, by what that leaves in the few blocks that carry it; p_of_refit
  std::map<int, double> least_p = {};  ///< by hypothesis: no column of it is more certain; p_in_its_blocks
};
/// `residual`: of the hypothesis' refit; `place`: what it started from; `kept` holds the functions.
[[nodiscard]] Yardstick yardstick_beside(const Screen& screen, const Around& place, Responses& kept,
                                         int hypothesis, const Eigen::VectorXd& residual);
/// What errors of one deviation make of weighted rows, which no block's scatter shows: in a run's mean pressure, all runs side by side; and in what
/// the whole day shares, the valves' lag by which a pressure's noise is told (quiet_pressure.hpp) and a torque that bends between its samples.
struct ErrorsOfReading {
  static constexpr Eigen::Index kOfDay = 2;
  Eigen::VectorXd of_run, of_day[kOfDay];
};
[[nodiscard]] ErrorsOfReading errors_of_reading(const Around& place);
/// p-value of what one refit closes, by the scatter of what it leaves. With δ = before − after, n_b = Σ_b δ², l_b = Σ_b after·δ:
///
///   t = (Σ n_b + Σ l_b)/√Σ (l_b/(1 − h_b))²,  h_b = n_b/Σ n,  with as many degrees of freedom as blocks carry δ, less one;
///   whole runs instead of blocks, where those scatter more; `errors` add (Σ δ e)² to the scatter's square, of runs each by itself
///
/// A column by itself takes for scatter what an effect's other amplitudes make of it: an unbalanced mass of 270 sigma, m g l sin(φ + φ₀) of free
/// runs only, had p = 0.04.
[[nodiscard]] double p_of_refit(const Prepared& data, const Eigen::VectorXd& before,
                                const Eigen::VectorXd& after, const ErrorsOfReading& errors = {});
/// p-value of what one refit closes in blocks so few that the noise's variance is taken from elsewhere, V = unit Σ n_b. With W = Σ (l_b/(1 − h_b))²,
/// which ν_W tell: the noise may be louder in these very blocks, or of another colour, W > V. Two blocks speak for its being as elsewhere:
///
///   F = (2 + ν_W W/V)/(2 + ν_W),   t = |Σ n_b + Σ l_b|/√(F V),   F²/(1/ν_V + (F − 1)²/(2 + ν_W)) degrees of freedom
///
/// (the moderated t of Smyth 2004, its prior's own weight two); where W ≤ V, t = |…|/√V with ν_V.
/// Of 500 days without an effect in a recorded noise 24 had p ≤ 0.01 by V alone, seven of ten a compliance near 9 Hz, where few decays of the free
/// joint were a hundred times as loud as the middle of the day.
[[nodiscard]] double p_in_its_blocks(const Prepared& data, const Eigen::VectorXd& before,
                                     const Eigen::VectorXd& after, const ErrorsOfReading& errors,
                                     const Elsewhere& elsewhere);
/// The tests once more, after the blocks were cut anew, or with another yardstick for one hypothesis.
void judge(Screen& screen, const Prepared& data, const Library& library, const ScreenOptions& options,
           const Yardstick& yardstick = {});

/// One p-value of the flips' and of the rare columns', which share a level: the smallest level at which either speaks. Up to `level` half
/// is the flips'; beyond it nearly all. Valid by the union bound, as both shares grow with the level.
[[nodiscard]] double joint_p(double flips, double rare, double level) noexcept;

/// p-value of the largest |Σ g|/√Σ g² over columns (rows: blocks), or of a smaller statistic that stands for it, by joint sign flips of
/// the blocks.
struct FlipTest {
  double statistic = 0, p_value = 1;
  double limit = 0;  ///< that the largest T of noise passes with the probability asked for
};
[[nodiscard]] FlipTest flip_test(const Eigen::MatrixXd& block_scores, int flips, std::uint64_t seed,
                                 double significance, std::optional<double> observed = std::nullopt,
                                 int threads = 1);

/// Generic functions of the measured signals, one column each: what an unknown effect may look like.
class Dictionary {
 public:
  explicit Dictionary(const Prepared& data);
  [[nodiscard]] std::size_t size() const noexcept;
  [[nodiscard]] std::string name(std::size_t column) const;  ///< "torque: sgn |angle|"
  [[nodiscard]] Chain chain(std::size_t column) const;
  /// The same function in another chain, which the data must have.
  [[nodiscard]] std::size_t in(std::size_t column, Chain chain) const;
  [[nodiscard]] std::vector<std::string> variables(std::size_t column) const;
  [[nodiscard]] Eigen::VectorXd rows(std::size_t column) const;
  /// Several side by side; a row's signals are scaled once for all of them.
  [[nodiscard]] Eigen::MatrixXd rows(const std::vector<std::size_t>& columns) const;
  /// All functions of one chain, a column each, in the rows `of` that chain.
  [[nodiscard]] Eigen::MatrixXd rows_of(Chain chain, std::vector<Eigen::Index>& of) const;

 private:
  struct Signals;
  struct At;
  const Prepared* data_;
  std::shared_ptr<const Signals> signals_;
  std::vector<Chain> chains_;
};

/// The functions of all chains, at hand for one residual after another; 8 bytes for each row and function.
class GenericFunctions {
 public:
  explicit GenericFunctions(const Prepared& data, int threads = 1);
  /// A residual without what the functions can make of it, chain by chain: mostly noise, whatever is missing. Chains of fewer than twenty
  /// rows for each function stay as they are.
  [[nodiscard]] Eigen::VectorXd beside(const Eigen::VectorXd& residual) const;

 private:
  struct OfChain {
    std::vector<Eigen::Index> at;
    Eigen::MatrixXd x, gram;
  };
  std::vector<OfChain> chains_;
};

}  // namespace isac::explain
