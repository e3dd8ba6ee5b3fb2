#include "isac/explain/signed_fit.hpp"

#include "isac/estimate/linear_algebra.hpp"

namespace isac::explain {

SignedFit signed_fit(const Eigen::MatrixXd& gram, const Eigen::VectorXd& score,
                     const std::vector<bool>& positive_only) {
  const int n = static_cast<int>(score.size());
  SignedFit best;
  best.amplitude = Eigen::VectorXd::Zero(n);
  for (int mask = 1; mask < (1 << n); ++mask) {
    std::vector<int> use;
    for (int i = 0; i < n; ++i)
      if ((mask >> i & 1) != 0 && gram(i, i) > 0) use.push_back(i);
    if (use.empty()) continue;
    const auto k = static_cast<Eigen::Index>(use.size());
    Eigen::MatrixXd g(k, k);
    Eigen::VectorXd s(k);
    for (Eigen::Index i = 0; i < k; ++i) {
      s[i] = score[use[static_cast<std::size_t>(i)]];
      for (Eigen::Index j = 0; j < k; ++j)
        g(i, j) = gram(use[static_cast<std::size_t>(i)], use[static_cast<std::size_t>(j)]);
      g(i, i) *= 1 + 1e-6;
    }
    const Eigen::VectorXd a = estimate::solve_symmetric(g, s);
    bool allowed = a.allFinite();
    for (Eigen::Index i = 0; i < k && allowed; ++i)
      allowed = !positive_only[static_cast<std::size_t>(use[static_cast<std::size_t>(i)])] || a[i] >= 0;
    if (!allowed) continue;
    const double gain = s.dot(a);
    if (gain <= best.gain) continue;
    best.gain = gain;
    best.amplitude.setZero();
    for (Eigen::Index i = 0; i < k; ++i) best.amplitude[use[static_cast<std::size_t>(i)]] = a[i];
  }
  return best;
}

}  // namespace isac::explain
