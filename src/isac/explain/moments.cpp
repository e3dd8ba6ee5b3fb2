#include "isac/explain/moments.hpp"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

namespace isac::explain {
namespace {

constexpr double kBeyondUsual = 4;  // times the usual mean square: in 32 empty datasets it reached 5 once
constexpr double kStandOut =
    0.03;  // of the noise's power; those had 0.006 at most, ten that hid such an effect 0.07 to 1.04 but for one
// The balance of a free joint's motion differentiates the encoder's noise twice, and where a recorded one is louder for a second it had 6 to 9 times
// the usual mean square on 6 of 370 empty days; fifteen stops that were struck had 8 to 376, and one of them less than 11.
constexpr double kBurst = 10;
constexpr double kFewestRowsOfAtom = 20;  // of an atom that counts
constexpr std::size_t kFewestAtoms = 20;

double median(std::vector<double> x) {
  const auto middle = x.begin() + static_cast<std::ptrdiff_t>(x.size() / 2);
  std::nth_element(x.begin(), middle, x.end());
  return *middle;
}

struct Atom {
  unsigned run = 0;
  double rows = 0, squares = 0, first = 0, last = 0;  // s
  [[nodiscard]] double mean_square() const { return squares / rows; }
};

std::vector<Atom> atoms_of(const Prepared& data, const Eigen::VectorXd& residual, Chain chain) {
  std::map<std::pair<unsigned, unsigned>, Atom> atoms;
  for (std::size_t i = 0; i < data.rows.size(); ++i) {
    const Row& row = data.rows[i];
    if (row.chain != chain) continue;
    Atom& a = atoms[{row.run, row.atom}];
    const double r = residual[static_cast<Eigen::Index>(i)], t = data.runs[row.run].time[row.sample];
    if (a.rows == 0) {
      a.run = row.run;
      a.first = t;
    }
    a.last = t;
    a.squares += r * r;
    ++a.rows;
  }
  std::vector<Atom> enough;
  for (const auto& [index, a] : atoms)
    if (a.rows >= kFewestRowsOfAtom) enough.push_back(a);
  return enough;
}

Moments moments_in(const Prepared& data, const Eigen::VectorXd& residual, Chain chain) {
  Moments found{.chain = chain};
  const std::vector<Atom> atoms = atoms_of(data, residual, chain);
  if (atoms.size() < kFewestAtoms) return found;
  std::vector<double> all;
  std::map<unsigned, std::vector<double>> by_run;
  double rows = 0, excess = 0;
  for (const Atom& a : atoms) {
    all.push_back(a.mean_square());
    by_run[a.run].push_back(a.mean_square());
    rows += a.rows;
  }
  const double usual = median(all);
  if (!(usual > 0)) return found;
  std::map<unsigned, double> of_run;
  for (const auto& [run, squares] : by_run) of_run[run] = std::max(usual, median(squares));
  for (const Atom& a : atoms) {
    const double beyond = a.mean_square() - kBeyondUsual * of_run[a.run];
    if (!(beyond > 0)) continue;
    excess += beyond * a.rows;
    if (a.mean_square() <= found.times_usual * usual) continue;
    found.times_usual = a.mean_square() / usual;
    found.run = a.run;
    found.time = 0.5 * (a.first + a.last);
  }
  found.share = excess / (usual * rows);
  return found;
}

}  // namespace

bool Moments::stand_out() const noexcept {
  return share >= kStandOut && (chain != Chain::kMotion || times_usual >= kBurst);
}

Moments moments_of(const Prepared& data, const Eigen::VectorXd& residual) {
  Moments largest;
  for (const Chain chain : {Chain::kTorque, Chain::kPressure1, Chain::kPressure2, Chain::kMotion})
    if (data.has(chain))
      if (const Moments here = moments_in(data, residual, chain);
          here.stand_out() != largest.stand_out() ? here.stand_out() : here.share > largest.share)
        largest = here;
  return largest;
}

}  // namespace isac::explain
