#include "isac/explain/workers.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <numeric>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

namespace isac::explain {
namespace {

TEST(Workers, do_each_thing_once_whatever_their_number) {
  for (const int threads : {0, 1, 2, 3, 7})
    for (const std::size_t count : {0U, 1U, 2U, 500U}) {
      std::vector<int> done(count, 0);
      share_work(threads, count, [&](std::size_t i) { ++done[i]; });
      EXPECT_EQ(std::accumulate(done.begin(), done.end(), std::size_t{0}), count) << threads;
    }
}

TEST(Workers, share_and_keep_what_a_thread_keeps) {
  const auto who = [] {
    std::atomic<int> waiting{0};
    std::vector<std::thread::id> ids(2);
    share_work(2, 2, [&](std::size_t i) {
      ids[i] = std::this_thread::get_id();
      ++waiting;
      while (waiting < 2) std::this_thread::yield();  // both at once, or never
    });
    return std::set<std::thread::id>(ids.begin(), ids.end());
  };
  const std::set<std::thread::id> first = who(), then = who();
  EXPECT_EQ(first.size(), 2U);
  EXPECT_EQ(first, then);
}

TEST(Workers, do_work_within_work_and_beside_it) {
  std::atomic<int> done{0};
  const auto nested = [&] {
    share_work(2, 8, [&](std::size_t) { share_work(2, 8, [&](std::size_t) { ++done; }); });
  };
  std::thread other(nested);
  nested();
  other.join();
  EXPECT_EQ(done, 128);
}

TEST(Workers, share_what_the_only_task_shares) {
  std::set<std::thread::id> ids;
  share_work(2, 1, [&](std::size_t) {
    std::atomic<int> waiting{0};
    std::vector<std::thread::id> who(2);
    share_work(2, 2, [&](std::size_t i) {
      who[i] = std::this_thread::get_id();
      ++waiting;
      while (waiting < 2) std::this_thread::yield();
    });
    ids.insert(who.begin(), who.end());
  });
  EXPECT_EQ(ids.size(), 2U);
}

TEST(Workers, pass_on_what_work_throws_and_work_again) {
  for (const int threads : {1, 2}) {
    EXPECT_THROW(share_work(threads, 50,
                            [](std::size_t i) {
                              if (i == 7) throw std::runtime_error("seven");
                            }),
                 std::runtime_error);
    std::atomic<int> done{0};
    share_work(threads, 50, [&](std::size_t) { ++done; });
    EXPECT_EQ(done, 50);
  }
}

}  // namespace
}  // namespace isac::explain
