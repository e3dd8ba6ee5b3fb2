#include "isac/explain/workers.hpp"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace isac::explain {
namespace {

/// What one call asks for.
struct Job {
  const std::function<void(std::size_t)>* work = nullptr;
  std::size_t count = 0;
  std::atomic<std::size_t> next{0};
  std::atomic<bool> failed{false};
  std::exception_ptr failure;  ///< of who set `failed`

  void run() {
    for (std::size_t i = next++; i < count && !failed; i = next++) try {
        (*work)(i);
      } catch (...) {
        if (!failed.exchange(true)) failure = std::current_exception();
      }
  }
};

class Workers {
 public:
  ~Workers() {
    {
      const std::lock_guard lock(mutex_);
      ended_ = true;
    }
    wake_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

  /// False, and nothing done, where they serve another call.
  bool serve(Job& job, std::size_t helpers) {
    const std::unique_lock mine(serving_, std::try_to_lock);
    if (!mine) return false;
    while (threads_.size() < helpers)
      threads_.emplace_back([this, number = threads_.size()] { wait_and_work(number); });
    {
      const std::lock_guard lock(mutex_);
      job_ = &job;
      helpers_ = busy_ = helpers;
      ++call_;
    }
    wake_.notify_all();
    job.run();
    std::unique_lock lock(mutex_);
    done_.wait(lock, [&] { return busy_ == 0; });
    job_ = nullptr;
    return true;
  }

 private:
  void wait_and_work(std::size_t number) {
    std::size_t seen = 0;
    std::unique_lock lock(mutex_);
    for (;;) {
      wake_.wait(lock, [&] { return ended_ || (call_ != seen && job_ != nullptr && number < helpers_); });
      if (ended_) return;
      seen = call_;
      Job& job = *job_;
      lock.unlock();
      job.run();
      lock.lock();
      if (--busy_ == 0) done_.notify_one();
    }
  }

  std::mutex serving_;  ///< held by the call that is served
  std::mutex mutex_;    ///< of all that follows but the threads, which are the served call's
  std::condition_variable wake_, done_;
  Job* job_ = nullptr;
  std::size_t helpers_ = 0, busy_ = 0, call_ = 0;
  bool ended_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace

void share_work(int threads, std::size_t count, const std::function<void(std::size_t)>& work) {
  static Workers workers;
  thread_local bool within = false;  // a thread must not try a lock that it holds
  const std::size_t helpers =
      threads > 1 && count > 1 ? std::min(static_cast<std::size_t>(threads), count) - 1 : 0;
  Job job;
  job.work = &work;
  job.count = count;
  if (count == 1) {  // what it shares in its turn may still be shared
    work(0);
    return;
  }
  const bool outermost = !within;
  within = true;
  if (helpers == 0 || !outermost || !workers.serve(job, helpers)) job.run();
  within = !outermost;
  if (job.failure) std::rethrow_exception(job.failure);
}

}  // namespace isac::explain
