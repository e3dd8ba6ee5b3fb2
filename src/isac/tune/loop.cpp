#include "isac/tune/loop.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "isac/core/units.hpp"

namespace isac::tune {
namespace {

using Complex = std::complex<double>;
using Curve = std::function<Complex(double)>;

constexpr double kTurn = 0.2;  // rad between neighbours of the grid
constexpr int kDeepest = 40;   // halvings of one interval; beyond, the curve goes through the point itself
constexpr int kPointsPerDecade = 24;
constexpr double kMostPoints = 50000;
constexpr double kDelayTurn =
    1.0;  // rad that the longest delay may turn between neighbours: refine() must not see a whole turn

Complex value_of(const DelayedPolynomial& p, const Complex& s) {
  Complex sum = 0;
  for (const double a : p.coefficients) sum = sum * s + a;
  return p.delay != 0 ? sum * std::exp(-s * p.delay) : sum;
}

Complex sum_of(const std::vector<DelayedPolynomial>& terms, double omega) {
  Complex sum = 0;
  for (const DelayedPolynomial& p : terms) sum += value_of(p, {0, omega});
  return sum;
}

/// Fujiwara's bounds: every root of the polynomial has a magnitude between them.
void widen_by_roots(const std::vector<double>& p, double& low, double& high) {
  std::size_t first = 0, last = p.size();
  while (first < last && p[first] == 0) ++first;
  while (last > first && p[last - 1] == 0) --last;
  if (last - first < 2) return;
  double upper = 0, lower = std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; first + k < last; ++k) {
    const double root = 1.0 / static_cast<double>(k);
    upper = std::max(upper, std::pow(std::abs(p[first + k] / p[first]), root));
    const double ratio = std::abs(p[last - 1] / p[last - 1 - k]);
    if (std::isfinite(ratio)) lower = std::min(lower, std::pow(ratio, root));
  }
  low = std::min(low, 0.5 * lower);
  high = std::max(high, 2 * upper);
}

struct Span {
  double low, high;
  double delay = 0;  ///< s, the longest
};

/// Frequencies between which all that matters happens.
Span span_of(const Loop& loop) {
  double low = std::numeric_limits<double>::infinity(), high = 0, delay = 0;
  for (const auto* terms : {&loop.denominator, &loop.numerator})
    for (const DelayedPolynomial& p : *terms) {
      widen_by_roots(p.coefficients, low, high);
      if (p.delay > 0) high = std::max(high, 2 * kPi / p.delay);
      delay = std::max(delay, p.delay);
    }
  if (!(high > 0) || !std::isfinite(high)) return {1e-3, 1e3};
  low = std::isfinite(low) && low > 0 ? low : high * 1e-6;
  // Up to where every term is small against the highest power: from there on nothing turns any more.
  const auto rest = [&loop](double w) {
    const double lead = std::abs(loop.denominator[0].coefficients[0]) *
                        std::pow(w, static_cast<double>(loop.denominator[0].coefficients.size() - 1));
    double sum = 0;
    for (const auto* terms : {&loop.denominator, &loop.numerator})
      for (const DelayedPolynomial& p : *terms) {
        double power = 1;
        for (std::size_t i = p.coefficients.size(); i-- > 0; power *= w) {
          if (terms == &loop.denominator && &p == &loop.denominator[0] && i == 0) continue;
          sum += std::abs(p.coefficients[i]) * power;
        }
      }
    return sum / lead;
  };
  double top = high;
  for (int i = 0; i < 60 && !(rest(top) < 0.05); ++i) top *= 2;
  return {1e-3 * std::max(low, 1e-9 * high), top, delay};
}

void refine(const Curve& curve, const FrequencyPoint& a, const FrequencyPoint& b, int depth,
            std::vector<FrequencyPoint>& out) {
  const double turn = std::abs(std::arg(b.value * std::conj(a.value)));
  if (depth < kDeepest && turn > kTurn) {
    const double middle = std::sqrt(a.omega * b.omega);
    if (middle > a.omega && middle < b.omega) {
      const FrequencyPoint m{middle, curve(middle)};
      refine(curve, a, m, depth + 1, out);
      refine(curve, m, b, depth + 1, out);
      return;
    }
  }
  out.push_back(b);
}

std::vector<FrequencyPoint> trace(const Curve& curve, const Span& span) {
  const double ratio = std::pow(10.0, 1.0 / kPointsPerDecade);
  const double longest = span.delay > 0 ? std::max(kDelayTurn / span.delay, span.high / kMostPoints)
                                        : std::numeric_limits<double>::infinity();
  std::vector<FrequencyPoint> points{{span.low, curve(span.low)}};
  FrequencyPoint last = points.front();
  while (last.omega < span.high) {
    const double omega = std::min({last.omega * ratio, last.omega + longest, span.high});
    const FrequencyPoint next{omega, curve(omega)};
    refine(curve, last, next, 0, points);
    last = next;
  }
  return points;
}

/// ω in (a, b) where f changes its sign.
double bisect(const std::function<double(double)>& f, double a, double b) {
  const bool rising = f(b) > 0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (a + b);
    ((f(middle) > 0) == rising ? b : a) = middle;
  }
  return 0.5 * (a + b);
}

/// Where the curve crosses the negative real axis.
std::vector<FrequencyPoint> negative_crossings(const Loop& loop, const std::vector<FrequencyPoint>& points) {
  std::vector<FrequencyPoint> found;
  const auto imaginary = [&loop](double w) { return response(loop, w).imag(); };
  for (std::size_t i = 1; i < points.size(); ++i) {
    const Complex &a = points[i - 1].value, &b = points[i].value;
    if ((a.imag() > 0) == (b.imag() > 0) || !(a.real() < 0 || b.real() < 0)) continue;
    const double omega = bisect(imaginary, points[i - 1].omega, points[i].omega);
    const Complex value = response(loop, omega);
    if (value.real() < 0) found.push_back({omega, value});
  }
  return found;
}

double least_distance(const Loop& loop, const std::vector<FrequencyPoint>& points) {
  const auto distance = [&loop](double w) { return std::abs(1.0 + response(loop, w)); };
  std::size_t best = 0;
  for (std::size_t i = 1; i < points.size(); ++i)
    if (std::abs(1.0 + points[i].value) < std::abs(1.0 + points[best].value)) best = i;
  double a = points[best == 0 ? 0 : best - 1].omega;
  double b = points[std::min(best + 1, points.size() - 1)].omega;
  constexpr double kGolden = 0.6180339887498949;
  double c = b - kGolden * (b - a), d = a + kGolden * (b - a), at_c = distance(c), at_d = distance(d);
  for (int i = 0; i < 40; ++i) {
    if (at_c < at_d) {
      b = d, d = c, at_d = at_c, c = b - kGolden * (b - a), at_c = distance(c);
    } else {
      a = c, c = d, at_c = at_d, d = a + kGolden * (b - a), at_d = distance(d);
    }
  }
  return std::min({at_c, at_d, std::abs(1.0 + points[best].value)});
}

std::vector<double> scaled(std::vector<double> p, double factor) {
  for (double& a : p) a *= factor;
  return p;
}

std::vector<double> plus(std::vector<double> p, const std::vector<double>& q) {
  if (p.size() < q.size()) p.insert(p.begin(), q.size() - p.size(), 0.0);
  for (std::size_t i = 0; i < q.size(); ++i) p[p.size() - q.size() + i] += q[i];
  return p;
}

/// Without zeros before the highest power.
std::vector<double> trimmed(std::vector<double> p) {
  p.erase(p.begin(), std::find_if(p.begin(), p.end(), [](double a) { return a != 0; }));
  return p;
}

/// Pieces of a cascade, docs/derivations/tuning.md; every polynomial already times s² (1 + T_f s).
struct Cascade {
  std::vector<DelayedPolynomial> inside;  ///< what the controller does with its own command, and the plant
  std::vector<DelayedPolynomial> torque;  ///< fed back by the torque loop
  DelayedPolynomial position;             ///< fed back by the position loop
};

Cascade cascade_of(const JointModel& j, const JointModel& believed, const Gains& g, const Sampling& sampling,
                   bool unit_position) {
  const double r = j.wheel_radius, fast = sampling.interval / 2;
  const double slow = sampling.interval * (0.5 * sampling.outer_every + 1.0);
  const std::vector<double> motion = {j.inertia, j.muscle.D, -(j.muscle.A * r * r)},
                            valve = {j.valve.lag, 1.0};
  const std::vector<double> filter = {sampling.velocity_filter, 1.0}, s = {1.0, 0.0};
  const std::vector<double> pi = {g.torque.proportional, g.torque.integral};
  const bool cascade = g.structure == control::Structure::kCascade;
  const bool predicted = !cascade && g.model_pressure == control::ModelPressure::kPredicted;
  // All times the lag that a predicting model believes in.
  const std::vector<double> lag =
      predicted ? std::vector<double>{believed.valve.lag, 1.0} : std::vector<double>{1.0};
  const std::vector<double> through = multiply(scaled(pi, j.valve.gain * j.muscle.B * r), lag);
  const std::vector<double> plant = multiply(multiply(motion, valve), filter);

  Cascade c;
  std::vector<double> inside = multiply(multiply(multiply(plant, s), s), lag);
  if (cascade) {
    // The torque as measured: B r V u + (A r² − D s) φ = J s² φ.
    c.torque.push_back(
        {multiply(multiply(through, filter), {j.inertia, 0.0, 0.0, 0.0}), j.valve.dead_time + fast});
  } else {
    const double own = believed.muscle.B * r * (predicted ? believed.valve.gain : 1.0);
    inside = plus(std::move(inside), multiply(multiply(plant, scaled(pi, own)), s));
    // What the actuator model says of spring and damping, the speed filtered: (A r² (1 + T_f s) − D s).
    const std::vector<double> modelled =
        plus(scaled(filter, believed.muscle.A * r * r), {-believed.muscle.D, 0.0});
    c.torque.push_back({multiply(multiply(through, modelled), s), j.valve.dead_time + fast});
  }
  c.inside.push_back({trimmed(std::move(inside))});
  const std::vector<double> outer =
      unit_position ? s : std::vector<double>{g.position.proportional, g.position.integral};
  c.position = {multiply(multiply(through, filter), outer), j.valve.dead_time + slow};
  return c;
}

Loop pid_loop(const JointModel& j, const control::PidGains<double>& k, const Sampling& sampling) {
  const double r = j.wheel_radius, stiffness = -(j.muscle.A * r * r), gain = j.valve.gain * j.muscle.B * r;
  const double filter = sampling.derivative_filter;
  const std::vector<double> plant = multiply({j.inertia, j.muscle.D, stiffness}, {j.valve.lag, 1.0});
  const std::vector<double> pid =
      plus(multiply({k.proportional, k.integral}, {filter, 1.0}), {k.derivative, 0.0, 0.0});
  return {.numerator = {{scaled(pid, gain), j.valve.dead_time + sampling.interval / 2}},
          .denominator = {{trimmed(multiply(multiply(plant, {filter, 1.0}), {1.0, 0.0}))}}};
}

}  // namespace

std::vector<double> multiply(const std::vector<double>& p, const std::vector<double>& q) {
  std::vector<double> out(p.size() + q.size() - 1, 0.0);
  for (std::size_t i = 0; i < p.size(); ++i)
    for (std::size_t k = 0; k < q.size(); ++k) out[i + k] += p[i] * q[k];
  return out;
}

Loop plant_loop(const LagPlant& p) {
  const double t = p.time_constant;
  const std::vector<double> numerator =
      p.bend != 0 ? std::vector<double>{p.gain * p.bend, 0.0, p.gain} : std::vector<double>{p.gain};
  return {.numerator = {{numerator, p.dead_time}},
          .denominator = {{multiply({t * t, 2 * p.damping * t, 1.0}, {p.lag, 1.0})}}};
}

Loop plant_loop(const JointModel& j) {
  const double r = j.wheel_radius;
  return {.numerator = {{{j.valve.gain * j.muscle.B * r}, j.valve.dead_time}},
          .denominator = {{multiply({j.inertia, j.muscle.D, -(j.muscle.A * r * r)}, {j.valve.lag, 1.0})}}};
}

Loop control_loop(const JointModel& joint, const Gains& gains, const Sampling& sampling,
                  const JointModel& believed) {
  if (gains.structure == control::Structure::kPid) return pid_loop(joint, gains.position, sampling);
  Cascade c = cascade_of(joint, believed, gains, sampling, false);
  c.torque.push_back(std::move(c.position));
  return {.numerator = std::move(c.torque), .denominator = std::move(c.inside)};
}

Loop outer_loop(const JointModel& joint, const Gains& gains, const Sampling& sampling) {
  Cascade c = cascade_of(joint, joint, gains, sampling, true);
  c.inside.insert(c.inside.end(), c.torque.begin(), c.torque.end());
  return {.numerator = {std::move(c.position)}, .denominator = std::move(c.inside)};
}

Complex response(const Loop& loop, double omega) {
  return sum_of(loop.numerator, omega) / sum_of(loop.denominator, omega);
}

bool is_stable(const Loop& loop) {
  const Span span = span_of(loop);
  const double order = static_cast<double>(loop.denominator[0].coefficients.size() - 1);
  const double lead = loop.denominator[0].coefficients[0];
  const double at = std::sqrt(span.low * span.high);
  const Curve curve = [&](double w) {
    const Complex unit = std::polar(std::pow(std::hypot(w, at), order), order * std::atan2(w, at));
    return (sum_of(loop.denominator, w) + sum_of(loop.numerator, w)) / (lead * unit);
  };
  if (!(curve(0.0).real() > 0)) return false;  // a root at or right of 0, or not a number
  const std::vector<FrequencyPoint> points = trace(curve, span);
  double turned = std::arg(points.front().value);  // from the positive real axis at ω = 0
  for (std::size_t i = 1; i < points.size(); ++i) {
    const double step = std::arg(points[i].value * std::conj(points[i - 1].value));
    if (!(std::abs(step) < 1.5)) return false;  // goes through 0: a root on the axis
    turned += step;
  }
  return std::abs(turned) < 1.5;  // 0 or a multiple of π, the rest of the way adds less than 0.1
}

Margins margins(const Loop& loop) {
  Margins m;
  m.stable = is_stable(loop);
  const std::vector<FrequencyPoint> points = trace_response(loop);
  for (const FrequencyPoint& p : negative_crossings(loop, points)) {
    const double factor = 1 / std::abs(p.value);
    if (factor > 1 && factor < m.gain) {
      m.gain = factor;
      m.phase_crossover = p.omega;
    }
    if (factor < 1) m.gain_down = std::max(m.gain_down, factor);
  }
  const auto size = [&loop](double w) { return std::log(std::abs(response(loop, w))); };
  for (std::size_t i = 1; i < points.size(); ++i) {
    if ((std::abs(points[i - 1].value) > 1) == (std::abs(points[i].value) > 1)) continue;
    const double omega = bisect(size, points[i - 1].omega, points[i].omega);
    double phase = kPi + std::arg(response(loop, omega));  // 0 … 2π: how far it may fall back
    m.delay = std::min(m.delay, phase / omega);
    if (phase > kPi) phase = 2 * kPi - phase;
    if (phase < m.phase) {
      m.phase = phase;
      m.gain_crossover = omega;
    }
  }
  m.modulus = least_distance(loop, points);
  return m;
}

std::optional<Ultimate> ultimate(const Loop& loop) {
  // The size of L does not matter here: a walk upwards, until |L| has fallen well below what it was at the best crossing.
  constexpr int kMostSteps = 20000;
  const Span span = span_of(loop);
  const double longest = span.delay > 0 ? kDelayTurn / span.delay : std::numeric_limits<double>::infinity();
  const double ratio = std::pow(10.0, 1.0 / kPointsPerDecade);
  const Curve curve = [&loop](double w) { return response(loop, w); };
  std::optional<Ultimate> best;
  FrequencyPoint last{span.low, curve(span.low)};
  std::vector<FrequencyPoint> piece;
  for (int i = 0; i < kMostSteps && std::isfinite(last.omega); ++i) {
    const double omega = std::min(last.omega * ratio, last.omega + longest);
    const FrequencyPoint next{omega, curve(omega)};
    piece.assign(1, last);
    refine(curve, last, next, 0, piece);
    for (const FrequencyPoint& p : negative_crossings(loop, piece)) {
      const double gain = 1 / std::abs(p.value);
      if (!best || gain < best->gain) best = Ultimate{gain, 2 * kPi / p.omega};
    }
    last = next;
    const bool past = best && omega > 3 * 2 * kPi / best->period && std::abs(next.value) * best->gain < 0.5;
    const bool never = !best && span.delay == 0 && omega > 100 * span.high;
    if (past || never) break;
  }
  return best;
}

std::vector<FrequencyPoint> trace_response(const Loop& loop) {
  return trace([&loop](double w) { return response(loop, w); }, span_of(loop));
}

}  // namespace isac::tune
