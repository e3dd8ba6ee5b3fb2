#include "oracle.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "colour.hpp"
#include "known_runs.hpp"
#include "least_squares.hpp"
#include "plant.hpp"

namespace blind {
namespace {

constexpr double kStep = 1e-3;       // s, of the integrator: the rivals' responses need not be finer
constexpr std::size_t kStride = 25;  // rows between two triangles of 20 Hz
constexpr double kNear = 3.0;        // sigma
constexpr double kWorthMoving =
    0.5;  // of what is there without it: what is farther by sums of small responses is not simulated anew
constexpr int kMoves = 6;
constexpr double kNudge = 0.02, kFarthest = 3;  // of a shape's value, and so many of them at a time

class Oracle {
 public:
  explicit Oracle(const Dataset& d) : Oracle(d, NoiseOnly{}) {
    std::vector<Signals> bare(d.runs.size());
    for (std::size_t i = 0; i < d.runs.size(); ++i) {
      const RunPlan& run = d.runs[i];
      if (run.heldout) continue;
      bare[i] = simulate(d.rig, run, Hidden{}, kWrittenStep);
      const Signals& s = known_.bare(i);
      still_.push_back({i, pressure(true_base_, run.command_1, s.p1),
                        pressure(true_base_, run.command_2, s.p2), torque(true_base_, run, s)});
    }
    // What the integrator and the derivative leave at the truth's own step is no part of the effect.
    truth_ = stacked(true_base_, d.clean);
    const Column plain = stacked(true_base_, bare);
    for (std::size_t k = 0; k < truth_.size(); ++k) truth_[k] -= plain[k];
    sensitivities();
    fit_ = LeastSquares(base_, truth_);
    for (const Hiding& hiding : d.hidings) {
      true_columns_.push_back(response(*hiding.effect, hiding.amplitude, hiding.shape));
      if (d.hidings.size() > 1) slopes_.push_back(slopes_of(hiding, true_columns_.back()));
    }
  }

  /// Only the noise model is wanted of this one.
  struct NoiseOnly {};
  Oracle(const Dataset& d, NoiseOnly)
      : d_(d),
        true_base_{d.rig.A, d.rig.B, d.rig.C, d.rig.D, d.rig.K_C, d.rig.T_C},
        known_(d.rig, d.runs, kStep) {
    read_noise();
  }
  Oracle(const Oracle&) = delete;  // fit_ points into it
  Oracle& operator=(const Oracle&) = delete;

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
    v.none = fit_.distance({});
    std::vector<const Column*> truth;
    for (const Column& column : true_columns_) truth.push_back(&column);
    v.self = fit_.distance(truth);
    if (d_.hidings.size() > 1)
      for (std::size_t kept = 0; kept < d_.hidings.size(); ++kept)
        v.alone[d_.hidings[kept].effect->id] = fit_.distance(kept_columns(kept));
    Random random(d_.request.seed ^ 0xa0761d6478bd642full);
    for (const Effect& rival : effects()) {
      if (!rival.catalogued || hidden(rival.id)) continue;
      double nearest = 1e300;
      // Of two hidden effects one stays as it is and the other is swapped for the rival. (Beside one that is all by itself anything is as good.)
      if (d_.hidings.size() == 1)
        nearest = nearest_of(rival, kNoneKept, random);
      else
        for (std::size_t kept = 0; kept < d_.hidings.size(); ++kept)
          if (v.alone.at(d_.hidings[kept].effect->id) >= kNear)
            nearest = std::min(nearest, nearest_of(rival, kept, random));
      if (nearest == 1e300) continue;  // nobody can know that there are two
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

  /// How the response of a hidden effect changes with one value of its shape; without a name: with the same error of the other sensor, which
  /// the catalogue's effect has as a number of its own.
  struct Slope {
    std::string name;
    double change;  ///< of the value, for which the column stands
    Column column;
  };

  /// Beside a rival of the other, an effect that stays need not keep its place: a muscle goes slack at another angle beside a gain of the
  /// encoder. (A line's frequency is no matter of a slope.)
  [[nodiscard]] std::vector<Slope> slopes_of(const Hiding& hiding, const Column& here) {
    std::vector<Slope> slopes;
    for (const auto& [name, value] : hiding.shape) {
      const bool angle = name == "phi0" || name == "psi";
      if (name == "sign" || name == "sensor" || name == "of_B" || name == "side" || name == "N" ||
          name == "t" || name == "f")
        continue;
      const double change = angle ? 0.05 : kNudge * value;
      Shape moved = hiding.shape;
      moved[name] += change;
      Column column = response(*hiding.effect, hiding.amplitude, moved);
      for (std::size_t k = 0; k < column.size(); ++k) column[k] -= here[k];
      slopes.push_back({name, change, std::move(column)});
    }
    if (hiding.shape.contains("sensor")) {
      Shape other = hiding.shape;
      other["sensor"] = 3.0 - other["sensor"];
      slopes.push_back({"", 1.0, response(*hiding.effect, hiding.amplitude, other)});
    }
    return slopes;
  }

  [[nodiscard]] std::vector<const Column*> kept_columns(std::size_t kept) const {
    std::vector<const Column*> columns = {&true_columns_[kept]};
    for (const Slope& slope : slopes_[kept]) columns.push_back(&slope.column);
    return columns;
  }

  [[nodiscard]] bool hidden(const std::string& id) const {
    return std::any_of(d_.hidings.begin(), d_.hidings.end(),
                       [&](const Hiding& h) { return h.effect->id == id; });
  }

  /// What hiding `effect` adds to the whitened channels. Where it changes no signal, nothing is added.
  [[nodiscard]] Column response(const Effect& effect, double amplitude, const Shape& shape) {
    Hidden hidden;
    hidden.seed = d_.request.seed;
    effect.apply(hidden, amplitude, shape);
    Column column;
    column.reserve(truth_.size());
    const auto add = [&](const Column& with, const Column& without) {
      for (std::size_t k = 0; k < with.size(); ++k) column.push_back(with[k] - without[k]);
    };
    for (const Still& still : still_) {
      const RunPlan& run = d_.runs[still.run];
      const Signals &s = known_.simulated(still.run, hidden), &bare = known_.bare(still.run);
      if (&s == &bare) {
        column.resize(column.size() + still.p1.size() + still.p2.size() + still.torque.size(), 0.0);
        continue;
      }
      const bool same_p1 = s.p1 == bare.p1, same_p2 = s.p2 == bare.p2;
      add(same_p1 ? still.p1 : pressure(true_base_, run.command_1, s.p1), still.p1);
      add(same_p2 ? still.p2 : pressure(true_base_, run.command_2, s.p2), still.p2);
      const bool same = same_p1 && same_p2 && s.angle == bare.angle && s.F1 == bare.F1 && s.F2 == bare.F2;
      add(same ? still.torque : torque(true_base_, run, s), still.torque);
    }
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

  static constexpr double kMeanTime = kBlock * kRowTime;

  /// One run's residual of one pressure, whitened.
  [[nodiscard]] Column pressure(const std::vector<double>& residual) const {
    Column out;
    means(out, residual);
    pressure_colour(kMeanTime).whiten(out, 0);
    return out;
  }
  [[nodiscard]] Column pressure(const Baseline& base, const std::vector<double>& command,
                                const std::vector<double>& p) const {
    return pressure(pressure_residual(base, command, p));
  }

  /// One run's residual of the torque, whitened; of a free run `balance` and what moves it.
  [[nodiscard]] Column torque(const RunPlan& run, const std::vector<double>& torque,
                              const std::vector<double>& balance) const {
    Column out;
    if (!run.free) {
      means(out, torque);
      torque_colour(kMeanTime).whiten(out, 0);
      return out;
    }
    std::vector<double> motion = triangle_mean(torque);
    for (std::size_t k = 0; k < motion.size(); ++k) motion[k] -= balance[k];
    strides(out, balance);
    balance_colour(false).whiten(out, 0);
    const std::size_t from = out.size();
    strides(out, motion);
    balance_colour(true).whiten(out, from);
    return out;
  }
  [[nodiscard]] Column torque(const Baseline& base, const RunPlan& run, const Signals& signals) const {
    const Residuals r = torque_residuals(d_.rig, base, run, signals);
    return torque(run, r.torque, r.balance);
  }

  static void append(Column& out, const Column& part) { out.insert(out.end(), part.begin(), part.end()); }

  [[nodiscard]] Column stacked(const Baseline& base, const std::vector<Signals>& signals) const {
    Column out;
    for (std::size_t i = 0; i < d_.runs.size(); ++i) {
      const RunPlan& run = d_.runs[i];
      if (run.heldout) continue;
      append(out, pressure(base, run.command_1, signals[i].p1));
      append(out, pressure(base, run.command_2, signals[i].p2));
      append(out, torque(base, run, signals[i]));
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
        append(base_[a], pressure(zero));
        append(base_[a], pressure(zero));
        append(base_[a], torque(run, part, triangle_mean(zero)));
      }
      const auto slope = [&](const std::vector<double>& u) {
        std::vector<double> high = unit_lag(u, T * (1.0 + nudge));
        const std::vector<double> low = unit_lag(u, T * (1.0 - nudge));
        for (std::size_t k = 0; k < high.size(); ++k) high[k] = (high[k] - low[k]) / nudge;
        return high;
      };
      for (const auto* u : {&run.command_1, &run.command_2}) {
        append(base_[4], pressure(unit_lag(*u, T)));
        append(base_[5], pressure(slope(*u)));
      }
      for (const std::size_t a : {4u, 5u}) append(base_[a], torque(run, zero, triangle_mean(zero)));
    }
  }

  // ---------------------------------------------------------------------------------- distances

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
    double amplitude;
  };
  static constexpr std::size_t kNoneKept = static_cast<std::size_t>(-1);

  /// The rival with this shape, its amplitude sought: the response is linear in it only nearby.
  [[nodiscard]] Try with_shape(const Effect& rival, Shape shape, const std::vector<const Column*>& fixed,
                               double alone) {
    Try best{alone, {}, shape, 0.0};
    double amplitude = rival.typical;
    for (int round = 0; round < 3; ++round) {
      Column column = response(rival, amplitude, shape);
      std::vector<const Column*> extra = fixed;
      extra.push_back(&column);
      std::vector<double> weights;
      const double sigma = fit_.distance(extra, &weights), weight = weights.back();
      const bool allowed = weight > 0.0 || shape.contains("sign");
      if (allowed && sigma < best.sigma) best = {sigma, std::move(column), shape, amplitude};
      if (!allowed || sigma > std::max(2.0 * kNear, 0.5 * alone) || std::abs(weight - 1.0) < 0.1) break;
      if (weight < 0.0) shape["sign"] = -shape["sign"];
      const double next = std::clamp(amplitude * std::abs(weight), rival.typical * 1e-3, rival.largest);
      if (std::abs(next / amplitude - 1.0) < 0.05) break;
      amplitude = next;
    }
    return best;
  }

  /// The hand leads a joint, or lets it go, where the encoder shows what the recording shows.
  static void lead_to(const std::vector<double>& recorded, const std::vector<double>& shown, RunPlan& run) {
    if (run.free) {
      run.release_angle += recorded.front() - shown.front();
      return;
    }
    std::vector<double> apart(recorded.size());
    for (std::size_t k = 0; k < apart.size(); ++k) apart[k] = recorded[k] - shown[k];
    const std::vector<double> velocity = velocity_of(apart);
    for (std::size_t k = 0; k < apart.size(); ++k) {
      run.hand[k] += apart[k];
      run.hand_velocity[k] += velocity[k];
    }
  }

  /// With the base parameters moved in the simulation as well. A free joint goes elsewhere with another inertia or stiffness, so that there
  /// the responses of both are no sum: an added inertia and a gain of the encoder are the same equation, and were 5 to 20 sigma apart as sums.
  [[nodiscard]] double moved(const Effect& rival, const Try& near, std::size_t kept) const {
    Hiding stays;
    std::vector<const Column*> columns = {&near.column};
    if (kept != kNoneKept) {
      stays = d_.hidings[kept];
      for (const Column* column : kept_columns(kept)) columns.push_back(column);
    }
    Rig rig = d_.rig;
    std::vector<RunPlan> plans;
    for (const Still& still : still_) plans.push_back(d_.runs[still.run]);
    double nearest = near.sigma, amplitude = near.amplitude;
    for (int move = 0; move <= kMoves; ++move) {
      Hidden hidden;
      hidden.seed = d_.request.seed;
      if (kept != kNoneKept) stays.effect->apply(hidden, stays.amplitude, stays.shape);
      rival.apply(hidden, amplitude, near.shape);
      Column left = truth_;
      std::size_t k = 0;
      const auto take = [&](const Column& with, const Column& without) {
        for (std::size_t i = 0; i < with.size(); ++i) left[k++] -= with[i] - without[i];
      };
      for (std::size_t r = 0; r < still_.size(); ++r) {
        const Still& still = still_[r];
        const RunPlan& run = plans[r];
        const Signals s = simulate(rig, run, hidden, kStep);
        take(pressure(true_base_, run.command_1, s.p1), still.p1);
        take(pressure(true_base_, run.command_2, s.p2), still.p2);
        take(torque(true_base_, run, s), still.torque);
        lead_to(d_.clean[still.run].angle, s.angle, plans[r]);
      }
      double sum = 0.0;
      for (const double value : left) sum += value * value;
      const double sigma = std::sqrt(sum);
      nearest = std::min(nearest, sigma);
      std::vector<double> weights, base;
      LeastSquares(base_, left).distance(columns, &weights, &base);
      rig.A += base[0] / (rig.r * rig.r);
      rig.B += 2.0 * base[1] / rig.r;
      rig.C -= base[2];
      rig.D -= base[3];
      rig.K_C += base[4];
      rig.T_C *= std::exp(2.0 * base[5] / rig.K_C);
      amplitude = std::clamp(amplitude + weights[0] * near.amplitude, rival.typical * 1e-3, rival.largest);
      if (kept == kNoneKept) continue;
      stays.amplitude *= 1.0 + std::clamp(weights[1], -0.5, 0.5);
      for (std::size_t i = 0; i < slopes_[kept].size(); ++i) {
        const Slope& slope = slopes_[kept][i];
        if (slope.name.empty()) continue;
        stays.shape[slope.name] += slope.change * std::clamp(weights[2 + i], -kFarthest, kFarthest);
      }
    }
    return nearest;
  }

  double nearest_of(const Effect& rival, std::size_t kept, Random& random) {
    std::vector<const Column*> fixed;
    if (kept != kNoneKept) fixed = kept_columns(kept);
    const double alone = fit_.distance(fixed);
    const auto [by_sums, nearest] = nearest_by_sums(rival, fixed, alone, random);
    if (by_sums < kNear || by_sums > kWorthMoving * alone) return by_sums;
    return std::min(by_sums, moved(rival, nearest, kept));
  }

  /// Its sigma, and the try of one shape that is nearest.
  std::pair<double, Try> nearest_by_sums(const Effect& rival, std::vector<const Column*> fixed, double alone,
                                         Random& random) {
    std::vector<Try> tries;
    const auto take = [&](const Shape& shape) {
      if (Try one = with_shape(rival, shape, fixed, alone); !one.column.empty())
        tries.push_back(std::move(one));
      std::sort(tries.begin(), tries.end(), [](const Try& a, const Try& b) { return a.sigma < b.sigma; });
    };
    for (const Shape& shape : shapes_of(rival, random)) take(shape);
    if (tries.empty()) return {alone, {}};
    if (tries.size() == 1) return {tries[0].sigma, tries[0]};
    if (tries[0].sigma < 0.8 * alone && same_side(tries[0].shape, tries[1].shape)) {
      Shape middle = tries[0].shape;
      for (auto& [name, value] : middle)
        if (name != "sign" && name != "sensor" && name != "of_B" && name != "side" && name != "N")
          value = 0.5 * (value + tries[1].shape.at(name));
      take(middle);
    }
    if (!same_side(tries[0].shape, tries[1].shape)) return {tries[0].sigma, tries[0]};
    // Two shapes together, neither against the other, stand for those between them.
    fixed.push_back(&tries[0].column);
    fixed.push_back(&tries[1].column);
    std::vector<double> weights;
    const double together = fit_.distance(fixed, &weights);
    const std::size_t last = weights.size() - 1;
    if (weights[last] * weights[last - 1] < 0.0) return {tries[0].sigma, tries[0]};
    return {std::min(tries[0].sigma, together), tries[0]};
  }

  /// A fitted run of the rig in which nothing is hidden, and its whitened channels.
  struct Still {
    std::size_t run;
    Column p1, p2, torque;
  };

  const Dataset& d_;
  Baseline true_base_;
  KnownRuns known_;
  Colour force_, pressure_;
  std::vector<Still> still_;
  Column truth_;
  LeastSquares fit_;
  std::vector<Column> base_, true_columns_;
  std::vector<std::vector<Slope>> slopes_;  ///< of each of two hidden effects
};

}  // namespace

double whitened_noise(const Dataset& dataset, const std::vector<Signals>& noisy) {
  return Oracle(dataset, Oracle::NoiseOnly{}).whitened_noise(noisy);
}

Verdict judge(const Dataset& dataset) {
  return Oracle(dataset).verdict();
}

}  // namespace blind
