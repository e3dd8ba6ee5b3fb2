#include "isac/explain/spectrum.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <unsupported/Eigen/FFT>

#include "isac/core/units.hpp"

namespace isac::explain {
namespace {

constexpr std::size_t kSide = 24;       // bins of the local floor on either side
constexpr std::size_t kGuard = 2;       // bins beside a line that its leakage may reach
constexpr std::size_t kFirstBin = 8;    // cycles in a run: fewer are drift
constexpr double kCap = 9.0;            // nats that one of many runs may say
constexpr double kLineStandsOut = 3.0;  // nats
constexpr double kDriven = 7.0;         // nats by which a line of the motion is one
constexpr double kNotCounted = 0.4;     // s at the start of a run that no residual counts (proof.hpp)
constexpr int kHarmonics = 15;
// Of the squares of a line's amplitudes, without the noise's, what may differ between runs where the phase is that of one clock. Phases
// by chance stay below it in one of exp(0.75 R) cases at most, which of six runs is one in ninety (Rayleigh's test).
constexpr double kIncoherent = 0.25;

bool only_small_factors(std::size_t n) {
  for (const std::size_t p : {2U, 3U, 5U})
    while (n % p == 0) n /= p;
  return n == 1;
}

/// x_k of every bin: nats by which the bin stands above its neighbours; 0 where there are none. `floor`: their mean.
std::vector<double> above_floor(const std::vector<double>& power, std::vector<double>* floor = nullptr) {
  std::vector<double> sum(power.size() + 1, 0.0), x(power.size(), 0.0);
  if (floor != nullptr) floor->assign(power.size(), 0.0);
  for (std::size_t k = 0; k < power.size(); ++k) sum[k + 1] = sum[k] + power[k];
  for (std::size_t k = kFirstBin; k + 1 < power.size(); ++k) {
    // As many bins on either side: a slope of the spectrum cancels to first order.
    const std::size_t side = std::min({kSide, k - 1 - kGuard, power.size() - 1 - k - kGuard});
    if (side < 4 || k + kGuard + side + 1 > power.size()) continue;
    const double near =
        sum[k - kGuard] - sum[k - kGuard - side] + sum[k + kGuard + side + 1] - sum[k + kGuard + 1];
    const double m = 2.0 * static_cast<double>(side);
    if (near > 0) x[k] = m * std::log1p(power[k] / near);
    if (floor != nullptr) (*floor)[k] = near / m;
  }
  return x;
}

struct Spectrum {
  double resolution = 0;  ///< Hz
  std::size_t samples = 0;
  std::vector<double> x, floor;
  std::vector<unsigned char> driven;  ///< bins of which the motion or the command has a line
};

void mark(std::vector<unsigned char>& driven, double bin, double width) {
  const auto from = static_cast<std::size_t>(std::max(0.0, std::ceil(bin - width)));
  for (std::size_t k = from; k < driven.size() && static_cast<double>(k) <= bin + width; ++k) driven[k] = 1;
}

Spectrum spectrum_of(const Series& run) {
  Spectrum s;
  std::size_t n = 0;
  s.x = above_floor(periodogram(run.value, &n), &s.floor);
  s.samples = n;
  if (n == 0) return {};
  s.resolution = 1 / (static_cast<double>(n) * run.interval);
  s.driven.assign(s.x.size(), 0);
  for (const std::vector<double>& driver : run.drivers) {
    const std::vector<double> power = periodogram(driver);
    if (power.size() != s.x.size()) continue;
    const std::vector<double> x = above_floor(power);
    std::size_t strongest = 1;
    double all = 0;
    for (std::size_t k = 1; k < power.size(); ++k) {
      all += power[k];
      if (power[k] > power[strongest]) strongest = k;
      if (x[k] > kDriven) mark(s.driven, static_cast<double>(k), 2);
    }
    // A period that makes most of the signal: its harmonics too.
    double near = 0;
    for (std::size_t k = strongest > 2 ? strongest - 2 : 1; k <= strongest + 2 && k < power.size(); ++k)
      near += power[k];
    if (strongest >= 3 && near > 0.5 * all)
      for (int h = 1; h <= kHarmonics; ++h)
        mark(s.driven, h * static_cast<double>(strongest), 1.5 + 0.25 * h);
  }
  return s;
}

/// log of the probability that Gamma(shape, 1), shape whole, exceeds s.
double log_gamma_tail(double s, std::size_t shape) {
  double term = 1, sum = 1;
  for (std::size_t k = 1; k < shape; ++k) sum += term *= s / static_cast<double>(k);
  return std::log(sum) - s;
}

struct Amplitudes {
  double sine = 0, cosine = 0, gain = 0;
};

/// Least squares of s sin + c cos at one frequency; the series' mean is already out.
Amplitudes fit_line(const Series& run, double frequency) {
  const double turn = 2 * kPi * frequency;
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  double count = 0;
  // sin and cos by rotation, set right every 512 samples.
  const std::complex<double> step = std::polar(1.0, turn * run.interval);
  std::complex<double> z;
  for (std::size_t k = 0; k < run.value.size(); ++k) {
    if (k % 512 == 0) z = std::polar(1.0, turn * (run.start + static_cast<double>(k) * run.interval));
    const double y = run.value[k];
    if (std::isfinite(y)) {
      const Eigen::Vector3d row(z.imag(), z.real(), 1.0);
      a.noalias() += row * row.transpose();
      b += y * row;
      count += 1;
    }
    z *= step;
  }
  Amplitudes out;
  if (count < 10) return out;
  const Eigen::Vector3d q = a.ldlt().solve(b);
  const double mean = b[2] / count;
  out.sine = q[0];
  out.cosine = q[1];
  out.gain = q.dot(b) - mean * b[2];
  return out;
}

double gain_at(std::span<const Series> runs, const std::vector<std::size_t>& which, double frequency) {
  double sum = 0;
  for (const std::size_t r : which) sum += fit_line(runs[r], frequency).gain;
  return sum;
}

/// What a strong line leaks reaches the cap in bins beside its own, and they are alike: the one of them that explains most.
double strongest_near(std::span<const Series> runs, const std::vector<std::size_t>& which, double frequency,
                      double resolution) {
  constexpr int kBins = 4;
  double best = frequency, most = gain_at(runs, which, frequency);
  for (int k = -2 * kBins; k <= 2 * kBins; ++k) {
    const double near = frequency + 0.5 * k * resolution, gain = near > 0 ? gain_at(runs, which, near) : 0.0;
    if (gain <= most) continue;
    most = gain;
    best = near;
  }
  return best;
}

/// Golden section for the frequency that explains most, within one bin.
double refined(std::span<const Series> runs, const std::vector<std::size_t>& which, double frequency,
               double reach) {
  constexpr double kGolden = 0.6180339887498949;
  double low = frequency - reach, high = frequency + reach;
  double a = high - kGolden * (high - low), b = low + kGolden * (high - low);
  double fa = gain_at(runs, which, a), fb = gain_at(runs, which, b);
  while (high - low > 0.02 * reach) {
    if (fa > fb) {
      high = b;
      b = a;
      fb = fa;
      a = high - kGolden * (high - low);
      fa = gain_at(runs, which, a);
    } else {
      low = a;
      a = b;
      fa = fb;
      b = low + kGolden * (high - low);
      fb = gain_at(runs, which, b);
    }
  }
  return 0.5 * (low + high);
}

/// Does the common phase take something out of all runs together, those that say nothing about the line (for it may be their motion's) among them?
/// Of four runs phases are alike by chance in one of twenty cases.
bool shrinks_together(std::span<const Series> runs, const SpectralLine& line) {
  double taken = 0;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const double own = line.run_sine[r] * line.sine + line.run_cosine[r] * line.cosine,
                 all = line.sine * line.sine + line.cosine * line.cosine;
    taken += static_cast<double>(runs[r].value.size()) * (2 * own - all);
  }
  return taken > 0;
}

void measure(std::span<const Series> runs, const std::vector<Spectrum>& spectra,
             const std::vector<std::size_t>& which, SpectralLine& line) {
  line.run_sine.assign(runs.size(), 0.0);
  line.run_cosine.assign(runs.size(), 0.0);
  double sine = 0, cosine = 0, squares = 0, error2 = 0, gain = 0, power = 0;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const Amplitudes a = fit_line(runs[r], line.frequency);
    line.run_sine[r] = a.sine;
    line.run_cosine[r] = a.cosine;
    if (std::find(which.begin(), which.end(), r) == which.end()) continue;
    sine += a.sine;
    cosine += a.cosine;
    squares += a.sine * a.sine + a.cosine * a.cosine;
    // Noise of power I per bin leaves 2 I/n² in either amplitude.
    const Spectrum& s = spectra[r];
    const auto bin =
        std::min(static_cast<std::size_t>(std::lround(line.frequency / s.resolution)), s.floor.size() - 1);
    error2 += 2 * s.floor[bin] / (static_cast<double>(s.samples) * static_cast<double>(s.samples));
    gain += a.gain;
    for (const double v : runs[r].value)
      if (std::isfinite(v)) power += v * v;
  }
  const double count = static_cast<double>(which.size());
  const double noise = 2 * error2,  // of all `squares`
      differ = squares - (sine * sine + cosine * cosine) / count;
  line.sine = sine / count;
  line.cosine = cosine / count;
  line.repeats = (count < 1.5 || differ < noise + kIncoherent * std::max(0.0, squares - noise)) &&
                 shrinks_together(runs, line);
  // The square of an amplitude that noise made is taken off.
  line.amplitude = line.repeats ? std::hypot(line.sine, line.cosine)
                                : std::sqrt(std::max(0.0, (squares - 2 * error2) / count));
  line.amplitude_error = std::sqrt(error2) / count;
  line.rms = line.amplitude / std::sqrt(2.0);
  line.share = power > 0 ? std::clamp(gain / power, 0.0, 1.0) : 0.0;
}

}  // namespace

Phase phase_in(const Series& run, double frequency) {
  const Amplitudes a = fit_line(run, frequency);
  const double size = std::hypot(a.sine, a.cosine);
  return size > 0 ? Phase{a.sine / size, a.cosine / size} : Phase{};
}

std::vector<double> periodogram(std::span<const double> value, std::size_t* length) {
  std::size_t n = value.size();
  while (n > 0 && !only_small_factors(n)) --n;
  if (length != nullptr) *length = 0;
  if (n < 128) return {};
  // Without mean and trend, which would leak.
  double s1 = 0, st = 0, stt = 0, sy = 0, sty = 0;
  for (std::size_t k = 0; k < n; ++k) {
    if (!std::isfinite(value[k])) continue;
    const double t = static_cast<double>(k) / static_cast<double>(n) - 0.5;
    s1 += 1;
    st += t;
    stt += t * t;
    sy += value[k];
    sty += t * value[k];
  }
  if (s1 < 100) return {};
  const double det = s1 * stt - st * st;
  const double slope = det > 0 ? (s1 * sty - st * sy) / det : 0.0, mean = (sy - slope * st) / s1;
  std::vector<double> x(n, 0.0);
  for (std::size_t k = 0; k < n; ++k)
    if (std::isfinite(value[k]))
      x[k] = value[k] - mean - slope * (static_cast<double>(k) / static_cast<double>(n) - 0.5);
  Eigen::FFT<double> fft;
  fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
  std::vector<std::complex<double>> transform;
  fft.fwd(transform, x);
  std::vector<double> power(transform.size());
  for (std::size_t k = 0; k < power.size(); ++k) power[k] = std::norm(transform[k]);
  if (length != nullptr) *length = n;
  return power;
}

std::vector<SpectralLine> spectral_lines(std::span<const Series> runs, double significance,
                                         std::size_t most) {
  std::vector<Spectrum> spectra;
  double finest = std::numeric_limits<double>::infinity(), highest = 0;
  for (const Series& run : runs) {
    spectra.push_back(spectrum_of(run));
    const Spectrum& s = spectra.back();
    if (s.x.empty()) continue;
    finest = std::min(finest, s.resolution);
    highest = std::max(highest, s.resolution * static_cast<double>(s.x.size() - 2));
  }
  struct Peak {
    double frequency, log_p;
    std::vector<std::size_t> which;
  };
  std::vector<Peak> peaks;
  std::size_t tested = 0;
  for (double f = static_cast<double>(kFirstBin) * finest; f < highest; f += finest) {
    ++tested;
    double sum = 0;
    std::vector<double> said;
    std::vector<std::size_t> which;
    for (std::size_t r = 0; r < spectra.size(); ++r) {
      const Spectrum& s = spectra[r];
      if (s.x.empty()) continue;
      const auto k = static_cast<std::size_t>(std::lround(f / s.resolution));
      if (k < kFirstBin || k >= s.x.size() || s.driven[k] != 0) continue;
      said.push_back(s.x[k]);
      if (s.x[k] > kLineStandsOut) which.push_back(r);
    }
    if (said.empty() || 2 * which.size() < said.size()) continue;
    const double cap = std::max(kCap, 40.0 / static_cast<double>(said.size()));
    for (const double x : said) sum += std::min(x, cap);
    peaks.push_back({f, log_gamma_tail(sum, said.size()), std::move(which)});
  }
  std::stable_sort(peaks.begin(), peaks.end(),
                   [](const Peak& a, const Peak& b) { return a.log_p < b.log_p; });
  std::vector<SpectralLine> lines;
  for (const Peak& peak : peaks) {
    const double p = std::min(1.0, std::exp(peak.log_p) * static_cast<double>(tested));
    if (p > significance || lines.size() >= most) break;
    if (std::any_of(lines.begin(), lines.end(), [&](const SpectralLine& l) {
          return std::abs(l.frequency - peak.frequency) < 4 * finest;
        }))
      continue;
    SpectralLine line;
    line.p_value = p;
    line.runs = peak.which.size();
    line.frequency =
        refined(runs, peak.which, strongest_near(runs, peak.which, peak.frequency, finest), finest);
    measure(runs, spectra, peak.which, line);
    lines.push_back(std::move(line));
  }
  return lines;
}

std::vector<Series> residual_series(const Predictor& predictor, const ModelPoint& model, Chain chain) {
  const Prepared& data = predictor.data();
  std::vector<Series> out;
  for (std::size_t r = 0; r < data.runs.size(); ++r) {
    const PreparedRun& run = data.runs[r];
    Series s;
    s.interval = run.interval;
    const Predictor::FullRate rate = predictor.full_rate(model, r);
    const bool pressure = chain == Chain::kPressure1 || chain == Chain::kPressure2;
    const std::vector<unsigned char>& mask = pressure ? run.usable : run.loaded;
    const int side = chain == Chain::kPressure2 ? 1 : 0;
    const std::vector<double>& predicted = pressure                  ? rate.pressure[side]
                                           : chain == Chain::kMotion ? rate.motion
                                                                     : rate.torque;
    const std::vector<double>& measured = pressure                  ? run.raw_pressure[side]
                                          : chain == Chain::kMotion ? run.slow_torque
                                                                    : run.torque;
    if (!predicted.empty() && predicted.size() == measured.size()) {
      std::size_t first = 0, last = predicted.size();
      while (first < last && (mask[first] == 0 || run.time[first] < kNotCounted)) ++first;
      while (last > first && mask[last - 1] == 0) --last;
      s.start = first < last ? run.time[first] : 0.0;
      const auto cut = [&](const std::vector<double>& x) {
        return std::vector<double>(x.begin() + static_cast<std::ptrdiff_t>(first),
                                   x.begin() + static_cast<std::ptrdiff_t>(last));
      };
      for (std::size_t k = first; k < last; ++k)
        s.value.push_back(mask[k] != 0 ? measured[k] - predicted[k] : std::nan(""));
      for (int i = 0; i < 2 && chain == Chain::kTorque && !run.force[0].empty() && !run.force[1].empty(); ++i)
        for (std::size_t k = first; k < last; ++k)
          s.force[i].push_back(mask[k] != 0 ? run.force[i][k] : std::nan(""));
      for (const std::vector<double>& u : run.command)
        if (!u.empty()) s.drivers.push_back(cut(u));
      // A joint that is free answers to what disturbs it: only the command tells what was asked of it.
      if (!run.is_free && !run.angle.empty()) s.drivers.push_back(cut(run.angle));
    }
    out.push_back(std::move(s));
  }
  return out;
}

std::vector<SpectralLine> spectral_lines(const Predictor& predictor, const ModelPoint& model, Chain chain,
                                         double significance) {
  const std::vector<Series> runs = residual_series(predictor, model, chain);
  return spectral_lines(runs, significance);
}

}  // namespace isac::explain
