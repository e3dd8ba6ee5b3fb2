/// @file
/// Lines in the spectrum of what a model leaves over: mains hum, and whatever else turns or swings beside the joint.
///
///   I_r(f_k) periodogram of run r,  x_r = m log(1 + I_r/Σ_{m/2 bins on either side} I_r),   s(f) = Σ_r min(x_r, cap)
///
/// Where the spectrum of noise is smooth over the m bins, I_r/mean is F(2, 2m) whatever its colour, so x_r is exponential and s
/// exceeds a value with at most the probability of a Gamma(R, 1); Bonferroni over the frequencies (Fisher's test with a local
/// floor). `cap` keeps one run from speaking for all; in at least half of the runs that can show it the line must stand out.
/// Runs whose motion, command or pressure has a line there as well, or a harmonic of their period, say nothing about it.
/// Of the bins within four, which a strong line's leakage makes alike under the cap, the one that explains most is refined by least squares
/// over all runs; the phase is that of the run's clock if it repeats: Σ_r |a_r − ā|² below the noise's part and a quarter of the rest, and
/// Σ_r n_r (2 a_r·ā − |ā|²) > 0 over all runs, n_r samples.
/// Units: SI (N m, Pa, Hz). Threads: pure. Errors: none; too short runs are left out.
/// Source: Fisher 1929; Rayleigh 1880 for the phases; Thomson 1982 for the local F; docs/derivations/explain.md.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "isac/explain/predict.hpp"

namespace isac::explain {

/// A residual at an even rate; samples that are not to be used are NaN and count as zero.
struct Series {
  double interval = 0;  ///< s
  double start = 0;     ///< s, time of the first sample by the run's clock
  std::vector<double> value;
  std::vector<std::vector<double>> drivers;  ///< what the line must not stand in: motion, command
  std::vector<double> force[2];              ///< N as read, of the torque's samples, where the two are known
};

struct SpectralLine {
  double frequency = 0;         ///< Hz
  double sine = 0, cosine = 0;  ///< amplitudes by the run's clock; only if `repeats`
  double amplitude = 0;         ///< rms over the runs of √(s² + c²)
  double amplitude_error = 0;
  bool repeats = false;  ///< the phase is that of the run's clock
  double p_value = 1;    ///< over all frequencies
  double share = 0;      ///< of the residual's power
  double rms = 0;        ///< of the line where it is: amplitude/√2
  std::size_t runs = 0;  ///< in which it stands out
  /// Of every run, in the order given: amplitudes by its own clock (least squares).
  std::vector<double> run_sine, run_cosine;
};

/// Lines, strongest first; at most `most`.
[[nodiscard]] std::vector<SpectralLine> spectral_lines(std::span<const Series> runs, double significance,
                                                       std::size_t most = 3);

/// measured − predicted of one chain at the recording's rate (motion: low-passed as its rows), run by run.
[[nodiscard]] std::vector<Series> residual_series(const Predictor& predictor, const ModelPoint& model,
                                                  Chain chain);
[[nodiscard]] std::vector<SpectralLine> spectral_lines(const Predictor& predictor, const ModelPoint& model,
                                                       Chain chain, double significance = 0.001);

/// Direction of a line in one run: sine and cosine by its clock, s² + c² = 1.
struct Phase {
  double sine = 0, cosine = 0;
};
[[nodiscard]] Phase phase_in(const Series& run, double frequency);

/// |X(f_k)|² of a series without its mean and trend, f_k = k/(n Δt); n is the largest length ≤ size of factors 2, 3, 5 only.
[[nodiscard]] std::vector<double> periodogram(std::span<const double> value, std::size_t* length = nullptr);

}  // namespace isac::explain
