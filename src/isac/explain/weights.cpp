#include "isac/explain/weights.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "isac/explain/workers.hpp"

namespace isac::explain {
namespace {

bool is_slow(const Colour& c) {
  return (c.slow > 0 && c.memory > 0) || c.wander > 0;
}

}  // namespace

/// Decays, gains and scales of the noise's Kalman filter, row by row: they do not depend on what is filtered.
struct NoiseFilter {
  struct Gains {
    double stay1 = 0, stay2 = 0, gain1 = 0, gain2 = 0, scale = 1;
  };
  const Prepared* data = nullptr;
  std::size_t rows = 0;
  std::vector<Gains> gains;
  /// Of rows of the motion, where torque and motion have one zero: the row of the torque that last told it, −1 where none did.
  std::vector<std::ptrdiff_t> told_by;
  double share = 0;  ///< σ_torque/σ_motion

  NoiseFilter(const Prepared& of, const Weights& weights) : data(&of), rows(of.rows.size()), gains(rows) {
    const Colour(&colours)[kChains] = weights.colour;
    if (weights.one_zero) find_partners(weights);
    const Row* last = nullptr;
    double p11 = 0, p12 = 0, p22 = 0;
    double stay1 = 0, stay2 = 0;
    unsigned step = 0;
    for (std::size_t i = 0; i < rows; ++i) {
      const Row& row = of.rows[i];
      const Colour& c = colours[static_cast<int>(row.chain)];
      if (!is_slow(c)) {
        last = nullptr;
        continue;
      }
      Gains& g = gains[i];
      if (last == nullptr || last->run != row.run || last->chain != row.chain || row.sample <= last->sample) {
        p11 = c.slow, p12 = 0, p22 = c.wander;
        step = 0;
      } else {
        if (row.sample - last->sample != step) {
          step = row.sample - last->sample;
          const double dt = step * of.runs[row.run].interval;
          stay1 = c.memory > 0 ? std::exp(-dt / c.memory) : 0;
          stay2 = std::exp(-dt / kWanderMemory);
        }
        g.stay1 = stay1, g.stay2 = stay2;
        p11 = stay1 * stay1 * p11 + c.slow * (1 - stay1 * stay1);
        p12 *= stay1 * stay2;
        p22 = stay2 * stay2 * p22 + c.wander * (1 - stay2 * stay2);
      }
      const double to1 = p11 + p12, to2 = p12 + p22, spread = to1 + to2 + c.white;
      g.gain1 = to1 / spread, g.gain2 = to2 / spread;
      g.scale = std::sqrt(c.white / spread);
      p11 -= g.gain1 * to1, p12 -= g.gain1 * to2, p22 -= g.gain2 * to2;
      last = &row;
    }
  }

  void find_partners(const Weights& weights) {
    constexpr double kStillTold = 1.0;  // s
    share = weights.sigma[static_cast<int>(Chain::kTorque)] / weights.sigma[static_cast<int>(Chain::kMotion)];
    told_by.assign(rows, -1);
    std::size_t torque = 0;  // rows of a run's torque come before those of its motion, both by time
    for (std::size_t i = 0; i < rows; ++i) {
      const Row& row = data->rows[i];
      if (row.chain != Chain::kMotion) continue;
      if (i == 0 || data->rows[i - 1].chain != Chain::kMotion) torque = data->run_begin[row.run];
      const auto tells = [&](std::size_t k) {
        return data->rows[k].chain == Chain::kTorque && data->rows[k].sample <= row.sample;
      };
      if (!tells(torque)) continue;
      while (tells(torque + 1)) ++torque;
      if ((row.sample - data->rows[torque].sample) * data->runs[row.run].interval <= kStillTold)
        told_by[i] = static_cast<std::ptrdiff_t>(torque);
    }
  }

  /// The zero that a row of the motion shares, in its σ, from the zeros along the rows before.
  [[nodiscard]] double shared(std::size_t i, const std::vector<double>& zero) const {
    return told_by.empty() || told_by[i] < 0 ? 0.0 : share * zero[static_cast<std::size_t>(told_by[i])];
  }
};

bool Weights::is_coloured() const noexcept {
  return std::any_of(std::begin(colour), std::end(colour), is_slow);
}

void Weights::take(const Prepared& data) {
  filter = is_coloured() ? std::make_shared<const NoiseFilter>(data, *this) : nullptr;
}

namespace {

std::shared_ptr<const NoiseFilter> filter_of(const Prepared& data, const Weights& weights) {
  if (weights.filter && weights.filter->data == &data && weights.filter->rows == data.rows.size())
    return weights.filter;
  return weights.is_coloured() ? std::make_shared<const NoiseFilter>(data, weights) : nullptr;
}

}  // namespace

namespace {

/// What the filter remembers of N columns side by side: one column's next row waits for its last, and not for the others'.
template <int N>
struct Memories {
  double m1[N] = {}, m2[N] = {};
  std::vector<double> zero[N];

  Memories(std::size_t rows, bool one_zero) {
    for (auto& z : zero) z.resize(one_zero ? rows : 0);
  }
  /// `step(column, what is known of the row beforehand)` is the row's innovation.
  template <class Step>
  void take(const NoiseFilter& filter, std::size_t row, const Step& step) {
    const NoiseFilter::Gains& g = filter.gains[row];
    for (int c = 0; c < N; ++c) {
      m1[c] *= g.stay1;
      m2[c] *= g.stay2;
      const double innovation = step(c, filter.shared(row, zero[c]), m1[c], m2[c], g.scale);
      m1[c] += g.gain1 * innovation;
      m2[c] += g.gain2 * innovation;
      if (!zero[c].empty()) zero[c][row] = m2[c];
    }
  }
};

template <int N>
void weigh_some(const Prepared& data, const Weights& weights, const NoiseFilter* filter,
                Eigen::Ref<Eigen::MatrixXd> columns) {
  double* y[N];
  for (int c = 0; c < N; ++c) y[c] = columns.col(c).data();
  Memories<N> memories(data.rows.size(), filter != nullptr && weights.one_zero);
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const double sigma = weights.sigma[static_cast<int>(data.rows[i].chain)];
    for (int c = 0; c < N; ++c) y[c][i] /= sigma;
    if (filter == nullptr) continue;
    memories.take(*filter, i, [&](int c, double shared, double m1, double m2, double scale) {
      const double innovation = y[c][i] - shared - m1 - m2;
      y[c][i] = scale * innovation;
      return innovation;
    });
  }
}

template <int N>
void unfilter_some(const Prepared& data, const Weights& weights, const NoiseFilter& filter,
                   Eigen::Ref<Eigen::MatrixXd> columns) {
  double* e[N];
  for (int c = 0; c < N; ++c) e[c] = columns.col(c).data();
  Memories<N> memories(data.rows.size(), weights.one_zero);
  for (std::size_t i = 0; i < data.rows.size(); ++i)
    memories.take(filter, i, [&](int c, double shared, double m1, double m2, double scale) {
      const double innovation = e[c][i] / scale;
      e[c][i] = shared + m1 + m2 + innovation;
      return innovation;
    });
}

/// Calls work.operator()<N>(first column) for groups of four columns, and of one for what is left.
template <class Work>
void in_groups(Eigen::Index columns, int threads, const Work& work) {
  const Eigen::Index fours = columns / 4;
  share_work(threads, static_cast<std::size_t>(fours + columns % 4), [&](std::size_t group) {
    const auto g = static_cast<Eigen::Index>(group);
    if (g < fours)
      work.template operator()<4>(4 * g);
    else
      work.template operator()<1>(3 * fours + g);
  });
}

}  // namespace

void weigh(const Prepared& data, const Weights& weights, Eigen::Ref<Eigen::MatrixXd> columns, int threads) {
  const std::shared_ptr<const NoiseFilter> filter = filter_of(data, weights);
  in_groups(columns.cols(), threads, [&]<int N>(Eigen::Index first) {
    weigh_some<N>(data, weights, filter.get(), columns.middleCols(first, N));
  });
}

Eigen::VectorXd unfiltered(const Prepared& data, const Weights& weights, const Eigen::VectorXd& weighted) {
  const std::shared_ptr<const NoiseFilter> filter = filter_of(data, weights);
  Eigen::VectorXd rows = weighted;
  if (filter) unfilter_some<1>(data, weights, *filter, rows);
  return rows;
}

Eigen::MatrixXd unfiltered_each(const Prepared& data, const Weights& weights, Eigen::MatrixXd weighted) {
  const std::shared_ptr<const NoiseFilter> filter = filter_of(data, weights);
  if (!filter) return weighted;
  in_groups(weighted.cols(), 1, [&]<int N>(Eigen::Index first) {
    unfilter_some<N>(data, weights, *filter, weighted.middleCols(first, N));
  });
  return weighted;
}

Eigen::VectorXd without_shared_zero(const Prepared& data, const Weights& weights, Eigen::VectorXd rows) {
  Weights only;  // of the motion's rows nothing but the zero is taken off
  std::copy(std::begin(weights.sigma), std::end(weights.sigma), std::begin(only.sigma));
  only.colour[static_cast<int>(Chain::kTorque)] = weights.colour[static_cast<int>(Chain::kTorque)];
  only.one_zero = true;
  Eigen::VectorXd weighed = rows;
  for (std::size_t i = 0; i < data.rows.size(); ++i)
    weighed[static_cast<Eigen::Index>(i)] *= weights.sigma[static_cast<int>(data.rows[i].chain)];
  weigh(data, only, weighed);
  for (std::size_t i = 0; i < data.rows.size(); ++i)
    if (data.rows[i].chain == Chain::kMotion)
      rows[static_cast<Eigen::Index>(i)] = weighed[static_cast<Eigen::Index>(i)];
  return rows;
}

double log_likelihood(const Prepared& data, const Weights& weights, const Eigen::VectorXd& residual) {
  const std::shared_ptr<const NoiseFilter> filter = filter_of(data, weights);
  Eigen::VectorXd rows = residual;
  for (std::size_t i = 0; i < data.rows.size(); ++i)
    rows[static_cast<Eigen::Index>(i)] *= weights.sigma[static_cast<int>(data.rows[i].chain)];
  weigh(data, weights, rows);
  double sum = 0;
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const double white = weights.colour[static_cast<int>(data.rows[i].chain)].white,
                 e = rows[static_cast<Eigen::Index>(i)];
    sum += e * e / white + std::log(white) - (filter ? 2 * std::log(filter->gains[i].scale) : 0.0);
  }
  return -0.5 * sum;
}

}  // namespace isac::explain
