#include "isac/explain/left_over.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace isac::explain {
namespace {

constexpr double kDoubtful = 0.02;  // p of what a named model leaves over: one right name in fifty has it
// Of the first effect's size: an equation that is so nearly right is right. Noise of pressures is quick, noise of forces slow: less of it is noise.
constexpr double kWorthDoubting = 0.17, kWorthDoubtingOfPressure = 0.03,
                 kWorthDoubtingOfPressureIfSeldom = 0.015;
// Beside the joint that the catalogue is of, less counts (a motor's own remainder is 0.16), and still less where noise has it on one day in two hundred. From
// two floors on the effect's own equation may be what is left over, the more of it the larger the effect.
constexpr double kWorthDoubtingOfTheJoint = 0.1, kSeldomNoise = 0.005, kWorthDoubtingIfSeldom = 0.06,
                 kOwnErrorShowsFrom = 2;

std::vector<const Column*> function_columns(const Screen& screen) {
  std::vector<const Column*> functions;
  for (const Column& c : screen.columns)
    if (c.hypothesis < 0) functions.push_back(&c);
  return functions;
}

/// Some runs and what `functions` score in them; those of a chain that they have no rows of score nothing.
struct SomeRuns {
  const Prepared& data;
  std::vector<const Column*> functions{};

  SomeRuns(const Prepared& of, const std::vector<const Column*>& asked,
           const std::vector<const Column*>& known)
      : data(of) {
    static const Column kNone;
    for (const Column* a : asked) {
      const auto same = std::find_if(known.begin(), known.end(), [&](const Column* c) {
        return c->chain == a->chain && c->name == a->name;
      });
      functions.push_back(same != known.end() ? *same : &kNone);
    }
  }

  /// Of the blocks, and what the errors that runs and the day share make of it.
  Eigen::Index scores() const {
    return static_cast<Eigen::Index>(data.blocks + data.runs.size()) + ErrorsOfReading::kOfDay;
  }
  Eigen::VectorXd scores_of(std::size_t function) const {
    const Column& c = *functions[function];
    Eigen::VectorXd scores_of_blocks = Eigen::VectorXd::Zero(scores());
    if (!(c.norm2 > 0)) return scores_of_blocks;
    const Eigen::VectorXd& noise = c.noise();
    for (Eigen::Index a = 0; a < noise.size(); ++a)
      scores_of_blocks[data.block_of_atom[static_cast<std::size_t>(a)]] += noise[a];
    if (c.shared_error.size() > 0) scores_of_blocks.tail(c.shared_error.size()) = c.shared_error;
    return scores_of_blocks;
  }

  double rows_of(Chain chain) const {
    double rows = 0;
    for (const Row& row : data.rows) rows += row.chain == chain ? 1 : 0;
    return rows;
  }
};

/// `functions`: in the order of the runs' own.
LeftOver left_over_of(const std::vector<SomeRuns>& parts, const std::vector<const Column*>& functions,
                      const Found& found, const ScreenOptions& options) {
  Eigen::Index rows = 0;
  for (const SomeRuns& part : parts) rows += part.scores();
  Eigen::MatrixXd scores(rows, static_cast<Eigen::Index>(functions.size()));
  double largest = 0;
  std::size_t most = functions.size();
  for (std::size_t k = 0; k < functions.size(); ++k) {
    auto column = scores.col(static_cast<Eigen::Index>(k));
    Eigen::Index from = 0;
    double sum = 0;
    for (const SomeRuns& part : parts) {
      column.segment(from, part.scores()) = part.scores_of(k);
      from += part.scores();
      if (part.functions[k]->norm2 > 0) sum += part.functions[k]->score;
    }
    const double norm = column.norm(), T = norm > 0 ? std::abs(sum) / norm : 0.0;
    if (T <= largest) continue;
    largest = T;
    most = k;
  }
  LeftOver left;
  if (most == functions.size()) return left;
  // The errors of mean pressures have nothing in the sum, so the largest T is less than that of the scores themselves.
  left.p_value =
      flip_test(scores, options.flips, options.seed, options.significance, largest, options.threads).p_value;
  left.chain = functions[most]->chain;
  left.function = functions[most]->name;
  const auto c = static_cast<int>(left.chain);
  double score = 0, norm2 = 0, plain_norm2 = 0, count = 0;
  for (const SomeRuns& part : parts) {
    const Column& column = *part.functions[most];
    count += part.rows_of(left.chain);
    if (!(column.norm2 > 0)) continue;
    score += column.score;
    norm2 += column.norm2;
    plain_norm2 += column.plain_norm2[c];
  }
  const double sigma = found.weights.sigma[c], white = found.floors.white[c];
  if (norm2 > 0 && count > 0)
    left.size = std::abs(score) / norm2 * std::sqrt(plain_norm2 / count) *
                (std::isfinite(white) && white > sigma ? sigma / white : 1.0);
  return left;
}

}  // namespace

LeftOfRuns left_of_runs(const Prepared& data, const Library& library, const Found& found, const Proof& proof,
                        const ScreenOptions& options) {
  if (found.steps.size() <= found.added.size()) return {};  // nothing was looked for beside what was named
  ScreenOptions only_functions = options;
  only_functions.dictionary = true;
  only_functions.only.emplace();
  const Proof::Screened unseen = proof.screened(found.model, found.weights, library, only_functions);
  if (unseen.data == nullptr) return {};
  const std::vector<const Column*> functions = function_columns(found.steps.back().screen);
  if (functions.empty()) return {};
  const SomeRuns fitted(data, functions, functions),
      held_out(*unseen.data, functions, function_columns(unseen.screen));
  return {left_over_of({fitted, held_out}, functions, found, options),
          left_over_of({held_out}, functions, found, options)};
}

bool casts_a_doubt(double p_value, double size, Chain chain, double first_size, bool joint) noexcept {
  const bool seldom = p_value <= kSeldomNoise, pressure = (bit(chain) & kPressureChains) != 0;
  const double if_seldom = std::clamp(kWorthDoubtingIfSeldom * first_size / kOwnErrorShowsFrom,
                                      kWorthDoubtingIfSeldom, kWorthDoubtingOfTheJoint);
  const double of_torque = !joint ? kWorthDoubting : seldom ? if_seldom : kWorthDoubtingOfTheJoint;
  const double of_pressure = seldom ? kWorthDoubtingOfPressureIfSeldom : kWorthDoubtingOfPressure;
  return p_value <= kDoubtful && size >= (pressure ? of_pressure : of_torque) * first_size;
}

}  // namespace isac::explain
