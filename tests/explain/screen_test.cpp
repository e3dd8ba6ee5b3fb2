// The tests of a screen: where few blocks carry an effect, and where whole runs share their zero.
#include "isac/explain/screen.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tied_data.hpp"

namespace isac::explain {
namespace {

constexpr std::size_t kBlocks = 200, kCarry = 12;

/// One effect that a dozen of two hundred blocks carry, unequally, in noise whose scatter differs from block to block.
Screen screen_of(double sigma, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0.5, 2.0);
  Screen screen;
  Column c;
  c.hypothesis = 0;
  c.atom_score = c.atom_norm = Eigen::VectorXd::Zero(kBlocks);
  double all = 0;
  for (Eigen::Index b = 0; b < static_cast<Eigen::Index>(kCarry); ++b)
    all += c.atom_norm[b * 10] = uniform(random);
  for (Eigen::Index b = 0; b < static_cast<Eigen::Index>(kCarry); ++b) {
    const double norm2 = c.atom_norm[b * 10];
    c.atom_score[b * 10] =
        norm2 * sigma / std::sqrt(all) + std::sqrt(norm2) * uniform(random) * normal(random);
  }
  c.norm2 = c.chain_norm2[0] = all;
  c.score = c.atom_score.sum();
  screen.columns.push_back(c);
  return screen;
}

struct Setting {
  Prepared data;
  Library library;
  Setting() {
    const test::TiedRig rig;
    data = prepare(test::record_all(rig, {test::by_hand(20, 0.3, 1.0)}), rig.facts(), {}, 4.0);
    library = make_library(data);
    data.rows.clear();
    for (unsigned b = 0; b < kBlocks; ++b)
      data.rows.push_back({.run = 0, .sample = b, .atom = b, .block = b, .chain = Chain::kTorque});
    data.atoms = data.blocks = kBlocks;
    data.block_of_atom.clear();
    for (unsigned b = 0; b < kBlocks; ++b) data.block_of_atom.push_back(b);
  }
};

TEST(Judge, few_blocks_give_a_small_p_to_noise_no_more_often_than_it_says) {
  const Setting setting;
  std::mt19937_64 random(5);
  constexpr int kDraws = 2000;
  int small = 0, rare = 0;
  for (int i = 0; i < kDraws; ++i) {
    Screen screen = screen_of(0, random);
    judge(screen, setting.data, setting.library, {.flips = 19});
    ASSERT_LT(screen.columns[0].carried_by, kCarry + 0.5);
    small += screen.rare_p <= 0.05 ? 1 : 0;
    rare += screen.rare_p <= 0.01 ? 1 : 0;
  }
  EXPECT_LE(small, 0.065 * kDraws);  // three standard errors above 5 %
  EXPECT_GE(small, 0.015 * kDraws);  // a test that never rejects would say nothing
  EXPECT_LE(rare, 0.017 * kDraws);
}

TEST(Judge, few_blocks_that_agree_are_significant_although_they_are_their_own_yardstick) {
  const Setting setting;
  std::mt19937_64 random(6);
  for (int i = 0; i < 50; ++i) {
    Screen screen = screen_of(40, random);
    judge(screen, setting.data, setting.library, {.flips = 19});
    EXPECT_LT(screen.columns[0].T, std::sqrt(1.0 * kCarry) + 1e-9);  // below any limit of a whole search
    EXPECT_LT(screen.rare_p, 1e-4);
  }
}

constexpr unsigned kRuns = 10;

/// A response that rests within its runs, beside noise of its blocks and a zero of each run.
Screen resting_screen(double effect, double zero, double resting, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Screen screen;
  Column c;
  c.hypothesis = 0;
  c.resting = resting;
  c.atom_norm = Eigen::VectorXd::Ones(kBlocks);
  c.atom_score = Eigen::VectorXd::Zero(kBlocks);
  for (Eigen::Index run = 0; run < kRuns; ++run) {
    const double of_run = zero * normal(random);
    for (Eigen::Index b = 0; b < static_cast<Eigen::Index>(kBlocks / kRuns); ++b)
      c.atom_score[run * static_cast<Eigen::Index>(kBlocks / kRuns) + b] = effect + of_run + normal(random);
  }
  c.norm2 = c.chain_norm2[0] = kBlocks;
  c.score = c.atom_score.sum();
  screen.columns.push_back(c);
  return screen;
}

Setting setting_of_runs() {
  Setting setting;
  setting.data.runs.assign(kRuns, setting.data.runs.front());
  for (Row& row : setting.data.rows) row.run = row.block / (kBlocks / kRuns);
  return setting;
}

TEST(Judge, takes_no_zero_that_moves_between_runs_for_what_rests_within_them) {
  const Setting setting = setting_of_runs();
  std::mt19937_64 random(7);
  constexpr int kDraws = 2000;
  int by_runs = 0, by_blocks = 0;
  for (int i = 0; i < kDraws; ++i) {
    for (const double resting : {1.0, 0.0}) {
      Screen screen = resting_screen(0, 1.0, resting, random);
      judge(screen, setting.data, setting.library, {.flips = 19});
      (resting > 0 ? by_runs : by_blocks) += screen.columns[0].T > 1.96 ? 1 : 0;
    }
  }
  EXPECT_LE(by_runs, 0.065 * kDraws);  // three standard errors above 5 %
  EXPECT_GE(by_runs, 0.02 * kDraws);
  EXPECT_GE(by_blocks, 0.3 * kDraws);  // what blocks alone would make of it
}

TEST(Judge, still_sees_what_rests_within_runs_where_the_runs_agree) {
  const Setting setting = setting_of_runs();
  std::mt19937_64 random(8);
  int seen = 0;
  for (int i = 0; i < 200; ++i) {
    Screen screen = resting_screen(1.0, 0.0, 1.0, random);
    judge(screen, setting.data, setting.library, {.flips = 19});
    seen += screen.columns[0].T > 4 ? 1 : 0;
  }
  EXPECT_GE(seen, 190);
}

}  // namespace
}  // namespace isac::explain
