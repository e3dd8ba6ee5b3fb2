#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>

#include "isac/core/units.hpp"
#include "isac/estimate/linear_algebra.hpp"
#include "isac/explain/screen.hpp"
#include "isac/explain/workers.hpp"

namespace isac::explain {
namespace {

/// Signals of one row, each scaled to its range in the data.
struct Scaled {
  double angle, velocity, dp, p0, sign, time, day, rate1, rate2, age;
  double recent[3], warmth[2];  ///< velocity and speed of the last moments
};

constexpr double kRecent[] = {0.1, 0.3, 1.0};  // s, of a relaxation
constexpr double kWarmth[] = {3, 10};          // s, of what motion leaves behind

struct Function {
  const char* name;
  std::vector<std::string> variables;
  std::function<double(const Scaled&)> value;
};

const std::vector<Function>& functions() {
  static const std::vector<Function> all = {
      {"1", {}, [](const Scaled&) { return 1.0; }},
      {"angle", {"angle"}, [](const Scaled& s) { return s.angle; }},
      {"angle^2", {"angle"}, [](const Scaled& s) { return s.angle * s.angle; }},
      {"angle^3", {"angle"}, [](const Scaled& s) { return s.angle * s.angle * s.angle; }},
      {"angle^4", {"angle"}, [](const Scaled& s) { return std::pow(s.angle, 4); }},
      {"angle^5", {"angle"}, [](const Scaled& s) { return std::pow(s.angle, 5); }},
      {"|angle|", {"angle"}, [](const Scaled& s) { return std::abs(s.angle); }},
      {"velocity", {"velocity"}, [](const Scaled& s) { return s.velocity; }},
      {"velocity |velocity|",
       {"velocity"},
       [](const Scaled& s) { return s.velocity * std::abs(s.velocity); }},
      {"|velocity|", {"velocity"}, [](const Scaled& s) { return std::abs(s.velocity); }},
      {"velocity^5", {"velocity"}, [](const Scaled& s) { return std::pow(s.velocity, 5); }},
      {"sqrt|velocity| sgn",
       {"velocity"},
       [](const Scaled& s) { return std::sqrt(std::abs(s.velocity)) * s.sign; }},
      {"sgn", {"direction"}, [](const Scaled& s) { return s.sign; }},
      {"sgn |angle|", {"direction", "angle"}, [](const Scaled& s) { return s.sign * std::abs(s.angle); }},
      {"sgn angle", {"direction", "angle"}, [](const Scaled& s) { return s.sign * s.angle; }},
      {"sgn angle^2", {"direction", "angle"}, [](const Scaled& s) { return s.sign * s.angle * s.angle; }},
      {"sgn p_mean", {"direction", "mean_pressure"}, [](const Scaled& s) { return s.sign * s.p0; }},
      {"sgn |dp|", {"direction", "delta_pressure"}, [](const Scaled& s) { return s.sign * std::abs(s.dp); }},
      {"sgn dp", {"direction", "delta_pressure"}, [](const Scaled& s) { return s.sign * s.dp; }},
      {"sgn time", {"direction", "time"}, [](const Scaled& s) { return s.sign * s.day; }},
      {"velocity |angle|",
       {"velocity", "angle"},
       [](const Scaled& s) { return s.velocity * std::abs(s.angle); }},
      {"velocity angle", {"velocity", "angle"}, [](const Scaled& s) { return s.velocity * s.angle; }},
      {"velocity angle^2",
       {"velocity", "angle"},
       [](const Scaled& s) { return s.velocity * s.angle * s.angle; }},
      {"velocity dp", {"velocity", "delta_pressure"}, [](const Scaled& s) { return s.velocity * s.dp; }},
      {"velocity |dp|",
       {"velocity", "delta_pressure"},
       [](const Scaled& s) { return s.velocity * std::abs(s.dp); }},
      {"velocity p_mean", {"velocity", "mean_pressure"}, [](const Scaled& s) { return s.velocity * s.p0; }},
      {"dp", {"delta_pressure"}, [](const Scaled& s) { return s.dp; }},
      {"dp^2", {"delta_pressure"}, [](const Scaled& s) { return s.dp * s.dp; }},
      {"dp^3", {"delta_pressure"}, [](const Scaled& s) { return s.dp * s.dp * s.dp; }},
      {"|dp|", {"delta_pressure"}, [](const Scaled& s) { return std::abs(s.dp); }},
      {"dp angle", {"delta_pressure", "angle"}, [](const Scaled& s) { return s.dp * s.angle; }},
      {"dp |angle|", {"delta_pressure", "angle"}, [](const Scaled& s) { return s.dp * std::abs(s.angle); }},
      {"dp angle^2", {"delta_pressure", "angle"}, [](const Scaled& s) { return s.dp * s.angle * s.angle; }},
      {"dp^2 angle", {"delta_pressure", "angle"}, [](const Scaled& s) { return s.dp * s.dp * s.angle; }},
      {"p_mean", {"mean_pressure"}, [](const Scaled& s) { return s.p0; }},
      {"p_mean angle", {"mean_pressure", "angle"}, [](const Scaled& s) { return s.p0 * s.angle; }},
      {"p_mean dp", {"mean_pressure", "delta_pressure"}, [](const Scaled& s) { return s.p0 * s.dp; }},
      {"p_mean^2", {"mean_pressure"}, [](const Scaled& s) { return s.p0 * s.p0; }},
      {"p1 rate", {"pressure_rate"}, [](const Scaled& s) { return s.rate1; }},
      {"p2 rate", {"pressure_rate"}, [](const Scaled& s) { return s.rate2; }},
      {"|p1 rate|", {"pressure_rate"}, [](const Scaled& s) { return std::abs(s.rate1); }},
      {"|p2 rate|", {"pressure_rate"}, [](const Scaled& s) { return std::abs(s.rate2); }},
      {"time", {"time"}, [](const Scaled& s) { return s.time; }},
      {"day", {"time"}, [](const Scaled& s) { return s.day; }},
      {"day angle", {"time", "angle"}, [](const Scaled& s) { return s.day * s.angle; }},
      {"day dp", {"time", "delta_pressure"}, [](const Scaled& s) { return s.day * s.dp; }},
      {"day velocity", {"time", "velocity"}, [](const Scaled& s) { return s.day * s.velocity; }},
      {"after reversal 0.02",
       {"direction", "memory"},
       [](const Scaled& s) { return s.sign * std::exp(-s.age / 0.02); }},
      {"after reversal 0.1",
       {"direction", "memory"},
       [](const Scaled& s) { return s.sign * std::exp(-s.age / 0.1); }},
      {"velocity of the last 0.1 s", {"memory", "velocity"}, [](const Scaled& s) { return s.recent[0]; }},
      {"velocity of the last 0.3 s", {"memory", "velocity"}, [](const Scaled& s) { return s.recent[1]; }},
      {"velocity of the last 1 s", {"memory", "velocity"}, [](const Scaled& s) { return s.recent[2]; }},
      {"sgn speed of the last 3 s",
       {"time", "direction"},
       [](const Scaled& s) { return s.sign * s.warmth[0]; }},
      {"sgn speed of the last 10 s",
       {"time", "direction"},
       [](const Scaled& s) { return s.sign * s.warmth[1]; }},
  };
  return all;
}

constexpr double kTypicalLag = 0.17;  // s, of a valve unit (seed 4.1)

/// A signal behind a first-order lag that has long stood at `start`.
std::vector<double> lagged(const std::vector<double>& x, double interval, double lag, double start) {
  const double keep = std::exp(-interval / lag);
  std::vector<double> out(x.size());
  double p = start;
  for (std::size_t k = 0; k < x.size(); ++k) {
    out[k] = p;
    p = x[k] + keep * (p - x[k]);
  }
  return out;
}

double largest(double so_far, double value) {
  return std::isfinite(value) ? std::max(so_far, std::abs(value)) : so_far;
}

}  // namespace

struct Dictionary::Signals {
  Scaled top{.angle = 1e-9,
             .velocity = 1e-9,
             .dp = 1e-9,
             .p0 = 1e-9,
             .sign = 1,
             .time = 1e-9,
             .day = 1e-9,
             .rate1 = 1e-9,
             .rate2 = 1e-9,
             .age = 1,
             .recent = {},
             .warmth = {}};
  struct Extra {
    std::vector<double> rate[2], age, sign, recent[std::size(kRecent)], warmth[std::size(kWarmth)];
    /// In a pressure's own chain the measured pressure would bring its slow noise along, which is the residual's; what was
    /// asked for has none.
    std::vector<double> asked[2], asked_rate[2];
  };
  std::vector<Extra> extra;
};

Dictionary::Dictionary(const Prepared& data) : data_(&data) {
  auto signals = std::make_shared<Signals>();
  Scaled& top = signals->top;
  signals->extra.resize(data.runs.size());
  for (std::size_t r = 0; r < data.runs.size(); ++r) {
    const PreparedRun& run = data.runs[r];
    Signals::Extra& e = signals->extra[r];
    const std::size_t n = run.time.size();
    const auto rate_of = [&](const std::vector<double>& p) {
      std::vector<double> rate(n, 0.0);
      for (std::size_t k = 5; k + 5 < n && !p.empty(); ++k)
        rate[k] = (p[k + 5] - p[k - 5]) / (10 * run.interval);
      return rate;
    };
    for (int i = 0; i < 2; ++i) {
      e.rate[i] = rate_of(run.pressure[i]);
      if (!run.has_command) continue;
      const std::vector<double>& command = run.command[i];
      e.asked[i] = lagged(command, run.interval, kTypicalLag, command.empty() ? 0.0 : command.front());
      e.asked_rate[i] = rate_of(e.asked[i]);
    }
    // What went before a recording is not known: it is taken to begin at rest.
    for (std::size_t i = 0; i < std::size(kRecent); ++i)
      e.recent[i] = lagged(run.velocity, run.interval, kRecent[i], 0);
    std::vector<double> speed = run.dry_velocity;
    for (double& w : speed) w = std::abs(w);
    for (std::size_t i = 0; i < std::size(kWarmth); ++i)
      e.warmth[i] = lagged(speed, run.interval, kWarmth[i], 0);
    e.age.assign(n, 1.0);
    e.sign.assign(n, 0.0);
    double sign = 0, at = 0;
    for (std::size_t k = 0; k < run.angle.size(); ++k) {
      const double w = run.dry_velocity[k];
      if (w != 0 && (w > 0 ? 1.0 : -1.0) != sign) {
        sign = w > 0 ? 1 : -1;
        at = run.angle[k];
      }
      e.age[k] = std::abs(run.angle[k] - at);
      e.sign[k] = w > 0 ? 1 : (w < 0 ? -1 : 0);
      top.angle = largest(top.angle, run.angle[k]);
      top.velocity = largest(top.velocity, run.velocity[k]);
      if (run.has_pressure) {
        top.dp = largest(top.dp, 0.5 * (run.pressure[1][k] - run.pressure[0][k]));
        top.p0 = largest(top.p0, 0.5 * (run.pressure[1][k] + run.pressure[0][k]) - data.rig.initial_pressure);
        top.rate1 = largest(top.rate1, e.rate[0][k]);
        top.rate2 = largest(top.rate2, e.rate[1][k]);
      }
      top.time = largest(top.time, run.time[k]);
      top.day = largest(top.day, run.day_offset + run.time[k]);
    }
  }
  signals_ = std::move(signals);
  for (const Chain chain : {Chain::kTorque, Chain::kPressure1, Chain::kPressure2, Chain::kMotion})
    if (data.has(chain)) chains_.push_back(chain);
}

std::size_t Dictionary::size() const noexcept {
  return chains_.size() * functions().size();
}

Chain Dictionary::chain(std::size_t column) const {
  return chains_[column / functions().size()];
}

std::size_t Dictionary::in(std::size_t column, Chain chain) const {
  const auto at = std::find(chains_.begin(), chains_.end(), chain) - chains_.begin();
  return static_cast<std::size_t>(at) * functions().size() + column % functions().size();
}

std::string Dictionary::name(std::size_t column) const {
  static constexpr const char* kNames[] = {"torque", "p1", "p2", "motion"};
  return std::string(kNames[static_cast<int>(chain(column))]) + ": " +
         functions()[column % functions().size()].name;
}

std::vector<std::string> Dictionary::variables(std::size_t column) const {
  return functions()[column % functions().size()].variables;
}

/// The signals of one row, scaled.
struct Dictionary::At {
  const Prepared& data;
  const Signals& signals;

  Scaled operator()(const Row& row) const {
    const PreparedRun& run = data.runs[row.run];
    const Signals::Extra& e = signals.extra[row.run];
    const Scaled& top = signals.top;
    const std::size_t k = row.sample;
    Scaled s{};
    if (!run.angle.empty()) {
      s.angle = run.angle[k] / top.angle;
      s.velocity = run.velocity[k] / top.velocity;
      s.sign = e.sign[k];
      s.age = e.age[k];
      for (std::size_t j = 0; j < std::size(kRecent); ++j) s.recent[j] = e.recent[j][k] / top.velocity;
      for (std::size_t j = 0; j < std::size(kWarmth); ++j) s.warmth[j] = e.warmth[j][k] / top.velocity;
    }
    if (run.has_pressure) {
      const bool own = row.chain == Chain::kPressure1 || row.chain == Chain::kPressure2;
      const auto &p = own ? e.asked : run.pressure, &rate = own ? e.asked_rate : e.rate;
      s.dp = 0.5 * (p[1][k] - p[0][k]) / top.dp;
      s.p0 = (0.5 * (p[1][k] + p[0][k]) - data.rig.initial_pressure) / top.p0;
      s.rate1 = rate[0][k] / top.rate1;
      s.rate2 = rate[1][k] / top.rate2;
    }
    s.time = run.time[k] / top.time;
    s.day = (run.day_offset + run.time[k]) / top.day;
    return s;
  }
};

Eigen::VectorXd Dictionary::rows(std::size_t column) const {
  return rows(std::vector<std::size_t>{column});
}

Eigen::MatrixXd Dictionary::rows(const std::vector<std::size_t>& columns) const {
  std::vector<Eigen::Index> of_chain[kChains];
  for (std::size_t c = 0; c < columns.size(); ++c)
    of_chain[static_cast<int>(chain(columns[c]))].push_back(static_cast<Eigen::Index>(c));
  const At at{*data_, *signals_};
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(data_->rows.size()),
                                              static_cast<Eigen::Index>(columns.size()));
  for (std::size_t i = 0; i < data_->rows.size(); ++i) {
    const Row& row = data_->rows[i];
    const std::vector<Eigen::Index>& asked = of_chain[static_cast<int>(row.chain)];
    if (asked.empty()) continue;
    const Scaled s = at(row);
    for (const Eigen::Index c : asked) {
      const double v = functions()[columns[static_cast<std::size_t>(c)] % functions().size()].value(s);
      if (std::isfinite(v)) out(static_cast<Eigen::Index>(i), c) = v;
    }
  }
  return out;
}

Eigen::MatrixXd Dictionary::rows_of(Chain chain, std::vector<Eigen::Index>& of) const {
  of.clear();
  for (std::size_t i = 0; i < data_->rows.size(); ++i)
    if (data_->rows[i].chain == chain) of.push_back(static_cast<Eigen::Index>(i));
  const At at{*data_, *signals_};
  Eigen::MatrixXd x(static_cast<Eigen::Index>(of.size()), static_cast<Eigen::Index>(functions().size()));
  for (Eigen::Index i = 0; i < x.rows(); ++i) {
    const Scaled s = at(data_->rows[static_cast<std::size_t>(of[static_cast<std::size_t>(i)])]);
    for (Eigen::Index c = 0; c < x.cols(); ++c) {
      const double v = functions()[static_cast<std::size_t>(c)].value(s);
      x(i, c) = std::isfinite(v) ? v : 0.0;
    }
  }
  return x;
}

GenericFunctions::GenericFunctions(const Prepared& data, int threads) {
  const Dictionary generic(data);
  chains_.resize(kChains);
  share_work(threads, kChains, [&](std::size_t c) {
    const auto chain = static_cast<Chain>(c);
    if (!data.has(chain)) return;
    OfChain of;
    of.x = generic.rows_of(chain, of.at);
    if (of.x.rows() < 20 * of.x.cols()) return;
    of.gram = estimate::gram_of(of.x);
    // Nearly dependent functions, and those that the data does not move, must not blow up.
    for (Eigen::Index i = 0; i < of.gram.cols(); ++i) of.gram(i, i) = of.gram(i, i) * (1 + 1e-6) + 1e-9;
    chains_[c] = std::move(of);
  });
  std::erase_if(chains_, [](const OfChain& of) { return of.at.empty() || of.gram.size() == 0; });
}

Eigen::VectorXd GenericFunctions::beside(const Eigen::VectorXd& residual) const {
  Eigen::VectorXd left = residual;
  for (const OfChain& of : chains_)
    left(of.at) -= of.x * estimate::solve_symmetric(of.gram, of.x.transpose() * residual(of.at));
  return left;
}

}  // namespace isac::explain
