#include "oracle.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "plant.hpp"

namespace blind {
namespace {

constexpr double kStep = 1e-3;       // s, of the integrator: the rivals' responses need not be finer
constexpr std::size_t kBlock = 5;    // rows in a mean of 100 Hz
constexpr std::size_t kStride = 25;  // rows between two triangles of 20 Hz
constexpr double kNear = 3.0;        // sigma

/// Variances of a channel's samples: a white part and one with memory.
struct Colour {
  double white = 0, slow = 0, stay = 0;

  void add(double variance, double memory, double sample_time) {
    if (variance <= 0.0) return;
    // Two slow parts become one with the memory of the larger.
    if (variance > slow) stay = std::exp(-sample_time / memory);
    slow += variance;
  }

  /// x becomes the innovations of its Kalman filter, of variance one.
  void whiten(std::vector<double>& x, std::size_t from) const {
    double estimate = 0.0, variance = slow;
    for (std::size_t k = from; k < x.size(); ++k) {
      const double innovation = x[k] - estimate, spread = variance + white, gain = variance / spread;
      x[k] = innovation / std::sqrt(spread);
      estimate = stay * (estimate + gain * innovation);
      variance = stay * stay * variance * (1.0 - gain) + slow * (1.0 - stay * stay);
    }
  }
};

/// White and slow part of a recorded noise of sd one, in means of kBlock rows.
Colour colour_of(const std::vector<double>& recorded) {
  std::vector<double> means;
  for (std::size_t k = 0; k + kBlock <= recorded.size(); k += kBlock) {
    double sum = 0.0;
    for (std::size_t i = 0; i < kBlock; ++i) sum += recorded[k + i];
    means.push_back(sum / static_cast<double>(kBlock));
  }
  double c[3] = {};
  for (std::size_t lag = 0; lag < 3; ++lag) {
    for (std::size_t k = lag; k < means.size(); ++k) c[lag] += means[k] * means[k - lag];
    c[lag] /= static_cast<double>(means.size());
  }
  Colour colour{c[0], 0.0, 0.0};
  if (c[1] <= 0.0) return colour;
  colour.stay = std::clamp(c[2] / c[1], 0.05, 0.98);
  colour.slow = std::min(c[1] / colour.stay, 0.95 * c[0]);
  colour.white = c[0] - colour.slow;
  // The picture is rough; its size is set so that the recording's own innovations have variance one.
  std::vector<double> innovations = means;
  colour.whiten(innovations, 0);
  double square = 0.0;
  for (const double x : innovations) square += x * x / static_cast<double>(innovations.size());
  colour.white *= square;
  colour.slow *= square;
  return colour;
}

class Oracle {
 public:
  explicit Oracle(const Dataset& d) : d_(d) {
    read_noise();
    const Baseline truth{d.rig.A, d.rig.B, d.rig.C, d.rig.D, d.rig.K_C, d.rig.T_C};
    still_ = stacked(truth, simulated(Hidden{}));
    // What the integrator and the derivative leave at the truth's own step is no part of the effect.
    truth_ = stacked(truth, d.clean);
    const Column plain = stacked(truth, simulated(Hidden{}, kWrittenStep));
    for (std::size_t k = 0; k < truth_.size(); ++k) truth_[k] -= plain[k];
    sensitivities();
    for (const Hiding& hiding : d.hidings)
      true_columns_.push_back(response(*hiding.effect, hiding.amplitude, hiding.shape));
  }

  /// Only the noise model is wanted of this one.
  struct NoiseOnly {};
  Oracle(const Dataset& d, NoiseOnly) : d_(d) { read_noise(); }

  [[nodiscard]] double whitened_noise(std::vector<Signals> noisy) const {
    for (std::size_t i = 0; i < noisy.size(); ++i)
      if (!d_.runs[i].free) noisy[i].angle = d_.clean[i].angle;
    const std::vector<double> with = stacked(d_.base, noisy), without = stacked(d_.base, d_.clean);
    double sum = 0.0;
    for (std::size_t k = 0; k < with.size(); ++k) sum += (with[k] - without[k]) * (with[k] - without[k]);
    return sum / static_cast<double>(with.size());
  }

  Verdict verdict() {
    Verdict v;
    v.none = distance({});
    std::vector<const Column*> truth;
    for (const Column& column : true_columns_) truth.push_back(&column);
    v.self = distance(truth);
    Random random(d_.request.seed ^ 0xa0761d6478bd642full);
    for (const Effect& rival : effects()) {
      if (!rival.catalogued || hidden(rival.id)) continue;
      double nearest = 1e300;
      // Of two hidden effects one stays as it is and the other is swapped for the rival.
      if (d_.hidings.size() == 1)
        nearest = nearest_of(rival, {}, random);
      else
        for (const auto& kept : true_columns_) nearest = std::min(nearest, nearest_of(rival, {kept}, random));
      v.rivals[rival.id] = nearest;
      if (nearest < kNear) v.equals.push_back(rival.id);
    }
    return v;
  }

 private:
  void read_noise() {
    force_ =
        d_.noise.recorded_force.empty() ? Colour{1.0 / kBlock, 0, 0} : colour_of(d_.noise.recorded_force);
    pressure_ = d_.noise.recorded_pressure.empty() ? Colour{1.0 / kBlock, 0, 0}
                                                   : colour_of(d_.noise.recorded_pressure);
  }

  using Column = std::vector<double>;

  [[nodiscard]] bool hidden(const std::string& id) const {
    return std::any_of(d_.hidings.begin(), d_.hidings.end(),
                       [&](const Hiding& h) { return h.effect->id == id; });
  }

  [[nodiscard]] std::vector<Signals> simulated(const Hidden& hidden, double step = kStep) const {
    std::vector<Signals> signals(d_.runs.size());
    for (std::size_t i = 0; i < d_.runs.size(); ++i)
      if (!d_.runs[i].heldout) signals[i] = simulate(d_.rig, d_.runs[i], hidden, step);
    return signals;
  }

  [[nodiscard]] Column response(const Effect& effect, double amplitude, const Shape& shape) const {
    Hidden hidden;
    hidden.seed = d_.request.seed;
    effect.apply(hidden, amplitude, shape);
    const Baseline truth{d_.rig.A, d_.rig.B, d_.rig.C, d_.rig.D, d_.rig.K_C, d_.rig.T_C};
    Column column = stacked(truth, simulated(hidden));
    for (std::size_t k = 0; k < column.size(); ++k) column[k] -= still_[k];
    return column;
  }

  // ---------------------------------------------------------------------------------- whitened channels

  [[nodiscard]] Colour torque_colour(double sample_time) const {
    const Noise& n = d_.noise;
    const double r = d_.rig.r, arm = d_.rig.B * r / std::numbers::sqrt2;  // of one pressure's noise in B r Δp
    const double forces = 2.0 * r * r * n.force_white * n.force_white,
                 pressures = arm * arm * n.pressure_white * n.pressure_white;
    Colour c;
    c.white = forces * force_.white + pressures * pressure_.white +
              (2.0 * r * r * n.force_step * n.force_step + arm * arm * n.pressure_step * n.pressure_step) /
                  12.0 / kBlock;
    c.slow = forces * force_.slow + pressures * pressure_.slow;
    c.stay = forces * force_.slow > pressures * pressure_.slow ? force_.stay : pressure_.stay;
    c.add(n.torque_coloured * n.torque_coloured, n.torque_memory, sample_time);
    c.add(2.0 * r * r * n.force_wander * n.force_wander, n.wander_memory, sample_time);
    c.add(arm * arm * n.pressure_coloured * n.pressure_coloured, n.pressure_memory, sample_time);
    return c;
  }

  [[nodiscard]] Colour pressure_colour(double sample_time) const {
    const Noise& n = d_.noise;
    Colour c;
    c.white = n.pressure_white * n.pressure_white * pressure_.white +
              n.pressure_step * n.pressure_step / 12.0 / kBlock;
    c.slow = n.pressure_white * n.pressure_white * pressure_.slow;
    c.stay = pressure_.stay;
    c.add(n.pressure_coloured * n.pressure_coloured, n.pressure_memory, sample_time);
    return c;
  }

  /// A triangle of ±25 rows lets 2/(3·25) of a white variance through and neighbours at 25 rows share a quarter of it,
  /// so that a sample counts as one of 1.5 times that variance.
  static double triangle_share() { return 1.5 * 2.0 / (3.0 * kStride); }

  [[nodiscard]] Colour balance_colour(bool motion) const {
    const Noise& n = d_.noise;
    const double r = d_.rig.r, arm = d_.rig.B * r / std::numbers::sqrt2, dt = kStride * kRowTime;
    const double acceleration =
        d_.rig.inertia * acceleration_noise(2.0 * std::numbers::pi / kEncoderSteps / std::sqrt(12.0));
    const double share = triangle_share() * kBlock;  // force_ and pressure_ are of means of kBlock rows
    Colour c;
    c.white = 1.5 * acceleration * acceleration;
    if (motion) {
      c.white += arm * arm *
                 (n.pressure_white * n.pressure_white * pressure_.white +
                  n.pressure_step * n.pressure_step / 12.0 / kBlock) *
                 share;
      c.slow = arm * arm * n.pressure_white * n.pressure_white * pressure_.slow;
      c.stay = std::pow(pressure_.stay, static_cast<double>(kStride) / kBlock);
      c.add(arm * arm * n.pressure_coloured * n.pressure_coloured, n.pressure_memory, dt);
    } else {
      c.white +=
          2.0 * r * r *
          (n.force_white * n.force_white * force_.white + n.force_step * n.force_step / 12.0 / kBlock) *
          share;
      c.slow = 2.0 * r * r * n.force_white * n.force_white * force_.slow;
      c.stay = std::pow(force_.stay, static_cast<double>(kStride) / kBlock);
      c.add(n.torque_coloured * n.torque_coloured, n.torque_memory, dt);
      c.add(2.0 * r * r * n.force_wander * n.force_wander, n.wander_memory, dt);
    }
    return c;
  }

  static void means(Column& out, const std::vector<double>& x) {
    for (std::size_t k = 0; k + kBlock <= x.size(); k += kBlock) {
      double sum = 0.0;
      for (std::size_t i = 0; i < kBlock; ++i) sum += x[k + i];
      out.push_back(sum / static_cast<double>(kBlock));
    }
  }
  static void strides(Column& out, const std::vector<double>& x) {
    for (std::size_t k = kStride; k + kStride < x.size(); k += kStride) out.push_back(x[k]);
  }

  /// One run's residuals, appended whitened. `torque` against the base model, `balance` (free only), both pressures.
  void append(Column& out, const RunPlan& run, const std::vector<double>& torque,
              const std::vector<double>& balance, const std::vector<double>& p1,
              const std::vector<double>& p2) const {
    constexpr double kMeanTime = kBlock * kRowTime;
    std::size_t from = out.size();
    const auto close = [&](const Colour& colour) {
      colour.whiten(out, from);
      from = out.size();
    };
    for (const auto* p : {&p1, &p2}) {
      means(out, *p);
      close(pressure_colour(kMeanTime));
    }
    if (!run.free) {
      means(out, torque);
      close(torque_colour(kMeanTime));
      return;
    }
    std::vector<double> motion = triangle_mean(torque);
    for (std::size_t k = 0; k < motion.size(); ++k) motion[k] -= balance[k];
    strides(out, balance);
    close(balance_colour(false));
    strides(out, motion);
    close(balance_colour(true));
  }

  [[nodiscard]] Column stacked(const Baseline& base, const std::vector<Signals>& signals) const {
    Column out;
    for (std::size_t i = 0; i < d_.runs.size(); ++i) {
      if (d_.runs[i].heldout) continue;
      const Residuals r = residuals(d_.rig, base, d_.runs[i], signals[i]);
      append(out, d_.runs[i], r.torque, r.balance, r.p1, r.p2);
    }
    return out;
  }

  /// Columns of A, B, C, D, K_C and T_C.
  void sensitivities() {
    base_.assign(6, {});
    const double T = d_.base.T_C, nudge = 1e-3;
    for (std::size_t i = 0; i < d_.runs.size(); ++i) {
      const RunPlan& run = d_.runs[i];
      if (run.heldout) continue;
      const Signals& s = d_.clean[i];
      const std::vector<double> v = velocity_of(s.angle), zero(v.size(), 0.0);
      std::vector<double> part(v.size());
      for (std::size_t a = 0; a < 4; ++a) {
        for (std::size_t k = 0; k < v.size(); ++k)
          part[k] = a == 0 ? s.angle[k] : a == 1 ? s.p2[k] - s.p1[k] : a == 2 ? v[k] * v[k] * v[k] : v[k];
        append(base_[a], run, part, triangle_mean(zero), zero, zero);
      }
      const auto slope = [&](const std::vector<double>& u) {
        std::vector<double> high = unit_lag(u, T * (1.0 + nudge));
        const std::vector<double> low = unit_lag(u, T * (1.0 - nudge));
        for (std::size_t k = 0; k < high.size(); ++k) high[k] = (high[k] - low[k]) / nudge;
        return high;
      };
      append(base_[4], run, zero, triangle_mean(zero), unit_lag(run.command_1, T),
             unit_lag(run.command_2, T));
      append(base_[5], run, zero, triangle_mean(zero), slope(run.command_1), slope(run.command_2));
    }
  }

  // ---------------------------------------------------------------------------------- distances

  /// Norm of what base parameters and `extra` leave of the truth; `weights` gets those of `extra`.
  double distance(const std::vector<const Column*>& extra, std::vector<double>* weights = nullptr) const {
    std::vector<const Column*> columns;
    for (const Column& column : base_) columns.push_back(&column);
    columns.insert(columns.end(), extra.begin(), extra.end());
    const std::vector<double> x = least_squares(columns, truth_);
    double sum = 0.0;
    for (std::size_t k = 0; k < truth_.size(); ++k) {
      double rest = truth_[k];
      for (std::size_t i = 0; i < columns.size(); ++i) rest -= x[i] * (*columns[i])[k];
      sum += rest * rest;
    }
    if (weights != nullptr) weights->assign(x.begin() + 6, x.end());
    return std::sqrt(sum);
  }

  /// An asymmetry is more on one side or on the other; between the two it is none, and another effect's name.
  static bool two_sided(const Shape& shape) { return shape.contains("phi_s_ratio"); }
  static bool same_side(const Shape& a, const Shape& b) {
    return !two_sided(a) || (a.at("ratio") > 1.0) == (b.at("ratio") > 1.0);
  }
  static Shape mirrored(Shape shape) {
    shape["ratio"] = 1.0 / shape["ratio"];
    return shape;
  }

  /// The shapes that are tried: both sensors, and a few draws of what is continuous.
  static std::vector<Shape> shapes_of(const Effect& rival, Random& random) {
    Shape one = rival.draw(random);
    if (one.contains("sign")) one["sign"] = 1.0;
    if (one.empty() || (one.size() == 1 && one.contains("sign"))) return {one};
    // Fifteen draws, of which the two ends and the middle of what shapes it most are tried.
    std::vector<Shape> draws;
    for (int i = 0; i < 15; ++i) draws.push_back(rival.draw(random));
    for (const char* name : {"v_s", "phi_s", "tau", "phi_e", "n", "phi0", "f", "N", "t"}) {
      if (!one.contains(name)) continue;
      std::sort(draws.begin(), draws.end(),
                [&](const Shape& a, const Shape& b) { return a.at(name) < b.at(name); });
      break;
    }
    std::vector<Shape> shapes = {draws[0], draws[7], draws[14]};
    if (two_sided(one)) shapes = {draws[0], draws[14], mirrored(draws[0]), mirrored(draws[14])};
    for (int i = 0; i < static_cast<int>(shapes.size()); ++i) {
      Shape& shape = shapes[static_cast<std::size_t>(i)];
      if (shape.contains("sign")) shape["sign"] = 1.0;
      if (shape.contains("sensor")) shape["sensor"] = 1.0 + i % 2;
      if (shape.contains("of_B")) shape["of_B"] = i % 2;
      if (shape.contains("side")) shape["side"] = i - 1.0;
    }
    return shapes;
  }

  struct Try {
    double sigma;
    Column column;
    Shape shape;
  };

  /// The rival with this shape, its amplitude sought: the response is linear in it only nearby.
  [[nodiscard]] Try with_shape(const Effect& rival, Shape shape, const std::vector<const Column*>& fixed,
                               double alone) const {
    Try best{alone, {}, shape};
    double amplitude = rival.typical;
    for (int round = 0; round < 3; ++round) {
      Column column = response(rival, amplitude, shape);
      std::vector<const Column*> extra = fixed;
      extra.push_back(&column);
      std::vector<double> weights;
      const double sigma = distance(extra, &weights), weight = weights.back();
      const bool allowed = weight > 0.0 || shape.contains("sign");
      if (allowed && sigma < best.sigma) best = {sigma, std::move(column), shape};
      if (!allowed || sigma > std::max(2.0 * kNear, 0.5 * alone) || std::abs(weight - 1.0) < 0.1) break;
      if (weight < 0.0) shape["sign"] = -shape["sign"];
      const double next = std::clamp(amplitude * std::abs(weight), rival.typical * 1e-3, rival.largest);
      if (std::abs(next / amplitude - 1.0) < 0.05) break;
      amplitude = next;
    }
    return best;
  }

  double nearest_of(const Effect& rival, const std::vector<Column>& kept, Random& random) const {
    std::vector<const Column*> fixed;
    for (const Column& column : kept) fixed.push_back(&column);
    const double alone = distance(fixed);
    std::vector<Try> tries;
    const auto take = [&](const Shape& shape) {
      if (Try one = with_shape(rival, shape, fixed, alone); !one.column.empty())
        tries.push_back(std::move(one));
      std::sort(tries.begin(), tries.end(), [](const Try& a, const Try& b) { return a.sigma < b.sigma; });
    };
    for (const Shape& shape : shapes_of(rival, random)) take(shape);
    if (tries.empty()) return alone;
    if (tries.size() == 1) return tries[0].sigma;
    if (tries[0].sigma < 0.8 * alone && same_side(tries[0].shape, tries[1].shape)) {
      Shape middle = tries[0].shape;
      for (auto& [name, value] : middle)
        if (name != "sign" && name != "sensor" && name != "of_B" && name != "side" && name != "N")
          value = 0.5 * (value + tries[1].shape.at(name));
      take(middle);
    }
    if (!same_side(tries[0].shape, tries[1].shape)) return tries[0].sigma;
    // Two shapes together, neither against the other, stand for those between them.
    fixed.push_back(&tries[0].column);
    fixed.push_back(&tries[1].column);
    std::vector<double> weights;
    const double together = distance(fixed, &weights);
    const std::size_t last = weights.size() - 1;
    if (weights[last] * weights[last - 1] < 0.0) return tries[0].sigma;
    return std::min(tries[0].sigma, together);
  }

  const Dataset& d_;
  Colour force_, pressure_;
  Column still_, truth_;
  std::vector<Column> base_, true_columns_;
};

}  // namespace

double whitened_noise(const Dataset& dataset, const std::vector<Signals>& noisy) {
  return Oracle(dataset, Oracle::NoiseOnly{}).whitened_noise(noisy);
}

Verdict judge(const Dataset& dataset) {
  return Oracle(dataset).verdict();
}

}  // namespace blind
