#include "runtime/share_out.h"

#include <algorithm>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <set>
#include <system_error>
#include <thread>
#include <vector>

namespace vsplat {
namespace {

class Sharing {
 public:
  explicit Sharing(const ShareOut& shared)
      : shared_(shared), ahead_(std::max(shared.ahead, shared.workers)), left_(workers_of(shared)) {
    for (std::size_t i = 0; i < shared.items; ++i) waiting_.insert(waiting_.end(), i);
  }

  // The number of workers that have work.
  static std::size_t workers_of(const ShareOut& shared) {
    return shared.owner.empty() ? std::min(shared.workers, shared.items) : shared.workers;
  }

  void serve(std::size_t worker) {
    while (const auto item = take(worker)) {
      try {
        shared_.work(worker, *item);
        finish(*item);
      } catch (const Error& e) {
        const bool of_device =
            e.status() == Status::device || e.status() == Status::compile || e.status() == Status::memory;
        if (!of_device) {
          end(*item);
          continue;
        }
        if (give_up(worker, *item, e)) return;
      } catch (...) {
        end(*item);
      }
    }
  }

  void do_without(std::size_t worker) {
    const std::lock_guard lock(mutex_);
    --left_;
    gone_.insert(worker);
  }

  void rethrow() const {
    if (error_) std::rethrow_exception(error_);
  }

 private:
  // Waits for an item that may be started; unset if all are finished or the call has ended.
  std::optional<std::size_t> take(std::size_t worker) {
    std::unique_lock lock(mutex_);
    for (;;) {
      if (ended_ || delivered_ == shared_.items) return std::nullopt;
      for (const std::size_t item : waiting_) {
        if (item - delivered_ >= ahead_) break;  // no waiting item is before delivered_; and no sum overflows
        if (!is_for(worker, item)) continue;
        waiting_.erase(item);
        return item;
      }
      changed_.wait(lock);
    }
  }
  bool is_for(std::size_t worker, std::size_t item) const {
    return shared_.owner.empty() || shared_.owner[item] == worker || gone_.count(shared_.owner[item]) > 0;
  }

  void finish(std::size_t item) {
    std::unique_lock lock(mutex_);
    finished_.insert(item);
    // One thread calls `done` at a time, without the lock; other threads leave their items to it and continue.
    if (telling_) return;
    telling_ = true;
    while (!finished_.empty() && *finished_.begin() == delivered_) {
      const std::size_t now = delivered_;
      lock.unlock();
      try {
        if (shared_.done) shared_.done(now);
      } catch (...) {
        end(now);
        return;  // telling_ stays true, so nothing after it is reported
      }
      lock.lock();
      finished_.erase(finished_.begin());
      ++delivered_;
      changed_.notify_all();
    }
    telling_ = false;
  }

  // Ends the call with the current exception.
  void end(std::size_t item) {
    const std::lock_guard lock(mutex_);
    if (!error_ || item < error_item_) {
      error_ = std::current_exception();
      error_item_ = item;
    }
    ended_ = true;
    changed_.notify_all();
  }

  // Retires a worker. Returns false if it was the last one, which ends the call.
  bool give_up(std::size_t worker, std::size_t item, const Error& error) {
    {
      const std::lock_guard lock(mutex_);
      if (--left_ > 0 && !ended_) {
        waiting_.insert(item);
        gone_.insert(worker);
        if (shared_.lost) shared_.lost(worker, item, error);
        changed_.notify_all();
        return true;
      }
    }
    end(item);
    return false;
  }

  const ShareOut& shared_;
  const std::size_t ahead_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::size_t left_;                                 // workers
  std::size_t delivered_ = 0;                        // items that `done` was called for
  std::set<std::size_t> waiting_, finished_, gone_;  // items, items, workers
  bool telling_ = false, ended_ = false;
  std::exception_ptr error_;
  std::size_t error_item_ = 0;
};

}  // namespace

void share_out(const ShareOut& shared) {
  if (shared.items == 0) return;
  Sharing sharing(shared);
  const std::size_t workers = Sharing::workers_of(shared);
  std::vector<std::thread> threads;
  for (std::size_t i = 1; i < workers; ++i) {
    try {
      threads.emplace_back([&sharing, i] { sharing.serve(i); });
    } catch (const std::system_error&) {  // no thread can be created: the other workers do its work
      sharing.do_without(i);
    }
  }
  sharing.serve(0);
  for (std::thread& thread : threads) thread.join();
  sharing.rethrow();
}

}  // namespace vsplat
