/// @file
/// From actuator (joint) angles φ to arm angles θ and back, and torques the other way (seed D.2.2,
/// `ArmToJointAngles`).
///
///   θ = K φ,   τ_φ = Kᵀ τ_θ      (power is the same on both sides: τ_φ · φ̇ = τ_θ · θ̇)
///
/// The seed says only that joints 3-4 and 5-6 are pairs. A differential is taken: θ3 = (φ3 + φ4)/2, θ4 = (φ3
/// − φ4)/2, and the same for 5-6; another arm sets another K. Units: rad, N m. Real time: fixed size, no
/// heap, noexcept. Errors: inverse_coupling() returns kOutOfRange for a singular K. Source: thesis table K3.
#pragma once

#include <array>
#include <cmath>

#include "isac/core/status.hpp"
#include "isac/models/arm/chain.hpp"

namespace isac::models {

template <class S, int N>
using Coupling = std::array<JointVector<S, N>, static_cast<std::size_t>(N)>;  ///< rows of K

/// K of the Soft Arm: joints 1 and 2 directly, 3-4 and 5-6 as differentials.
template <class S>
[[nodiscard]] constexpr Coupling<S, 6> soft_arm_coupling() noexcept {
  Coupling<S, 6> k{};
  k[0][0] = S(1);
  k[1][1] = S(1);
  for (std::size_t pair : {std::size_t{2}, std::size_t{4}}) {
    k[pair][pair] = S(0.5);
    k[pair][pair + 1] = S(0.5);
    k[pair + 1][pair] = S(0.5);
    k[pair + 1][pair + 1] = S(-0.5);
  }
  return k;
}

/// y = K x.
template <class S, int N>
[[nodiscard]] JointVector<S, N> multiply(const Coupling<S, N>& k, const JointVector<S, N>& x) noexcept {
  JointVector<S, N> y{};
  for (std::size_t i = 0; i < y.size(); ++i) {
    for (std::size_t j = 0; j < y.size(); ++j) y[i] += k[i][j] * x[j];
  }
  return y;
}

/// y = Kᵀ x.
template <class S, int N>
[[nodiscard]] JointVector<S, N> multiply_transposed(const Coupling<S, N>& k,
                                                    const JointVector<S, N>& x) noexcept {
  JointVector<S, N> y{};
  for (std::size_t i = 0; i < y.size(); ++i) {
    for (std::size_t j = 0; j < y.size(); ++j) y[i] += k[j][i] * x[j];
  }
  return y;
}

/// K⁻¹ by Gauss-Jordan with row pivoting; kOutOfRange when K is singular to working precision.
template <class S, int N>
[[nodiscard]] Status inverse_coupling(const Coupling<S, N>& k, Coupling<S, N>& inverse) noexcept {
  using std::abs;
  Coupling<S, N> work = k;
  inverse = {};
  const std::size_t n = work.size();
  for (std::size_t i = 0; i < n; ++i) inverse[i][i] = S(1);
  for (std::size_t col = 0; col < n; ++col) {
    std::size_t pivot = col;
    for (std::size_t row = col + 1; row < n; ++row) {
      if (abs(work[row][col]) > abs(work[pivot][col])) pivot = row;
    }
    if (!(abs(work[pivot][col]) > S(1e-6))) return Status::kOutOfRange;
    for (std::size_t j = 0; j < n; ++j) {
      const S w = work[col][j], v = inverse[col][j];
      work[col][j] = work[pivot][j];
      work[pivot][j] = w;
      inverse[col][j] = inverse[pivot][j];
      inverse[pivot][j] = v;
    }
    const S scale = S(1) / work[col][col];
    for (std::size_t j = 0; j < n; ++j) {
      work[col][j] *= scale;
      inverse[col][j] *= scale;
    }
    for (std::size_t row = 0; row < n; ++row) {
      if (row == col) continue;
      const S factor = work[row][col];
      for (std::size_t j = 0; j < n; ++j) {
        work[row][j] -= factor * work[col][j];
        inverse[row][j] -= factor * inverse[col][j];
      }
    }
  }
  return Status::kOk;
}

}  // namespace isac::models
