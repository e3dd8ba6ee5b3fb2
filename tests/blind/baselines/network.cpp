#include "network.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

namespace baselines {
namespace {

constexpr Eigen::Index kHidden = 32;
constexpr int kEpochs = 40, kBatch = 64, kPatience = 6;
constexpr double kRate = 3e-3;
constexpr std::size_t kMostSamples = 12000;

struct Adam {
  Eigen::ArrayXXd first, second;
  void move(Eigen::Ref<Eigen::MatrixXd> x, const Eigen::MatrixXd& slope, double rate, long step) {
    if (first.size() == 0) first = second = Eigen::ArrayXXd::Zero(x.rows(), x.cols());
    first = 0.9 * first + 0.1 * slope.array();
    second = 0.999 * second + 0.001 * slope.array().square();
    const double a = 1 - std::pow(0.9, step), b = 1 - std::pow(0.999, step);
    x.array() -= rate * (first / a) / ((second / b).sqrt() + 1e-8);
  }
};

}  // namespace

Network::Network(const Eigen::MatrixXd& inputs, const Eigen::VectorXd& target,
                 const std::vector<unsigned>& part, std::uint64_t seed) {
  const Eigen::Index d = inputs.rows();
  middle_ = inputs.rowwise().mean();
  spread_ =
      ((inputs.colwise() - middle_).rowwise().squaredNorm() / static_cast<double>(inputs.cols())).cwiseSqrt();
  for (Eigen::Index i = 0; i < d; ++i)
    if (!(spread_[i] > 0)) spread_[i] = 1;
  scale_ = std::max(1e-300, std::sqrt(target.squaredNorm() / static_cast<double>(target.size())));
  std::mt19937_64 random(seed);
  std::normal_distribution<double> gauss;
  inner_ = Eigen::MatrixXd::NullaryExpr(kHidden, d + 1, [&] { return gauss(random) / std::sqrt(d); });
  outer_ =
      Eigen::VectorXd::NullaryExpr(kHidden + 1, [&] { return 0.1 * gauss(random) / std::sqrt(kHidden); });

  std::vector<Eigen::Index> train, check;
  for (Eigen::Index i = 0; i < target.size(); ++i)
    (part[static_cast<std::size_t>(i)] % 5 == 4 ? check : train).push_back(i);
  if (check.empty()) check = train;
  for (auto* list : {&train, &check}) {
    std::shuffle(list->begin(), list->end(), random);
    if (list->size() > kMostSamples) list->resize(kMostSamples);
  }
  const auto prepared = [&](const std::vector<Eigen::Index>& list) {
    Eigen::MatrixXd z(d + 1, static_cast<Eigen::Index>(list.size()));
    z.topRows(d) = (inputs(Eigen::all, list).colwise() - middle_).array().colwise() / spread_.array();
    z.row(d).setOnes();
    return z;
  };
  const Eigen::MatrixXd z = prepared(train), z_check = prepared(check);
  const Eigen::VectorXd y = target(train) / scale_, y_check = target(check) / scale_;
  const auto error = [&] {
    const Eigen::MatrixXd h = (inner_ * z_check).array().tanh();
    return ((h.transpose() * outer_.head(kHidden)).array() + outer_[kHidden] - y_check.array())
        .square()
        .mean();
  };
  Adam adam_inner, adam_outer;
  Eigen::MatrixXd best_inner = Eigen::MatrixXd::Zero(kHidden, d + 1);
  Eigen::VectorXd best_outer = Eigen::VectorXd::Zero(kHidden + 1);
  double best = y_check.squaredNorm() / static_cast<double>(y_check.size());  // of saying nothing
  long step = 0;
  for (int epoch = 0, since = 0; epoch < kEpochs && since < kPatience; ++epoch, ++since) {
    for (Eigen::Index at = 0; at + kBatch <= z.cols(); at += kBatch) {
      const auto batch = z.middleCols(at, kBatch);
      const Eigen::MatrixXd h = (inner_ * batch).array().tanh();
      const Eigen::VectorXd miss =
          ((h.transpose() * outer_.head(kHidden)).array() + outer_[kHidden]).matrix() - y.segment(at, kBatch);
      Eigen::VectorXd slope_outer(kHidden + 1);
      slope_outer.head(kHidden) = h * miss / kBatch;
      slope_outer[kHidden] = miss.mean();
      const Eigen::MatrixXd back =
          (outer_.head(kHidden) * miss.transpose()).array() * (1 - h.array().square()) / kBatch;
      const Eigen::MatrixXd slope_inner = back * batch.transpose();
      ++step;
      adam_outer.move(outer_, slope_outer, kRate, step);
      adam_inner.move(inner_, slope_inner, kRate, step);
    }
    const double now = error();
    if (now >= best) continue;
    best = now;
    best_inner = inner_;
    best_outer = outer_;
    since = 0;
  }
  inner_ = best_inner;
  outer_ = best_outer;
}

double Network::operator()(const Eigen::VectorXd& input) const {
  Eigen::VectorXd z(input.size() + 1);
  z.head(input.size()) = (input - middle_).array() / spread_.array();
  z[input.size()] = 1;
  const Eigen::VectorXd h = (inner_ * z).array().tanh();
  return scale_ * (h.dot(outer_.head(kHidden)) + outer_[kHidden]);
}

}  // namespace baselines
