/// @file
/// The joint fit in one pass over blocks of a recording, for files larger than memory.
///
///   θ₁ = θ₀ + H⁻¹ g,   H = Σ Xᵀ H(r₀) X − S,   g = Σ Xᵀ Ω(r₀) r₀ + S θ₀,   r₀ = y − X θ₀
///
/// θ₀, the loss' scale and the weights of the noise come from a pilot: fit_joint's core on the first rows. One Newton step from there is
/// the least squares answer itself for the squared loss, and for Huber's within a fraction of a standard error. Covariance
/// by blocks of time as in fit_joint. Sums of several streams over parts of the data add up (`fork`, `merge`).
/// Memory: the pilot's rows, one block, at most 4096 sums; independent of the length of the file.
/// Real time: no. Threads: one stream per thread; merge afterwards. Throws isac::Error: usage for terms that are not linear,
/// "no_usable_data" as fit_joint. What needs all rows at once (residual tests, the cut, pictures) is left out of the answer.
/// Source: docs/derivations/joint_fit.md.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "isac/estimate/joint_fit.hpp"

namespace isac::estimate {

class StreamingJointFit {
 public:
  explicit StreamingJointFit(const JointFitOptions& options, std::size_t pilot_rows = 65536);
  ~StreamingJointFit();
  StreamingJointFit(StreamingJointFit&&) noexcept;
  StreamingJointFit& operator=(StreamingJointFit&&) noexcept;

  /// Makes the pilot from these rows instead of the first that are added; they are not counted.
  void learn(std::vector<JointRun> runs);
  /// Can every term be fitted from the pilot's rows? What they cannot tell is refused in the end.
  [[nodiscard]] bool knows_all_terms() const;
  /// Consecutive rows of a run; another name begins another run.
  void add(const JointRun& block);
  /// An empty stream with this one's pilot, for another part of the data. The pilot must be made (enough rows added).
  [[nodiscard]] StreamingJointFit fork() const;
  /// Adds the sums of a fork.
  void merge(StreamingJointFit& other);
  [[nodiscard]] JointFit finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace isac::estimate
