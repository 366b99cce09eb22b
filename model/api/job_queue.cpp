#include "model/api/job_queue.h"

#include <cstdlib>
#include <filesystem>
#include <set>
#include <system_error>

#include "model/api/device.h"
#include "runtime/device.h"
#include "runtime/fail.h"

vsplat_job_impl::~vsplat_job_impl() { vsplat_scene_release(scene); }

namespace vsplat::api {
namespace {

thread_local vsplat_device served = nullptr, lent = nullptr;

// Starts a job; returns false if it was asked to stop before.
bool begin(vsplat_device device, vsplat_job_impl& job) {
  const std::lock_guard lock(job.mutex);
  if (job.asked_to_stop) return false;
  device->context.go_on();  // clears a stop requested for an earlier job
  job.state = VSPLAT_JOB_RUNNING;
  return true;
}

// Ends a job. Calls `give_back` under the lock: a thread that waited for the job finds the device free, and one that
// stops the job stops no other call.
template <class F>
void end(vsplat_job_impl& job, vsplat_status status, const char* error, const F& give_back) {
  job.run = nullptr;
  const std::lock_guard lock(job.mutex);
  give_back();
  job.status = status;
  if (status != VSPLAT_OK) job.error = error;
  job.state = status == VSPLAT_OK                ? VSPLAT_JOB_DONE
              : status == VSPLAT_ERROR_CANCELLED ? VSPLAT_JOB_CANCELLED
                                                 : VSPLAT_JOB_FAILED;
}

void tell_end(vsplat_job_impl& job) {
  try {
    if (job.on_end) job.on_end(job.user, &job);
  } catch (...) {  // an exception has no receiver here
  }
  const std::lock_guard lock(job.mutex);
  job.end_reported = true;
  job.changed.notify_all();
}

}  // namespace

JobQueue::~JobQueue() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(state_->mutex);
    state_->ends = true;
    state_->changed.notify_all();
  }
  // A device's last reference may be released with its last job, on this very thread.
  if (thread_.get_id() == std::this_thread::get_id())
    thread_.detach();
  else
    thread_.join();
}

// Never destroyed: threads may outlive static objects.
struct JobQueue::All {
  std::mutex mutex;
  std::set<std::shared_ptr<State>> serving;
  bool leaving = false;  // the process is exiting
};

JobQueue::All& JobQueue::all() {
  static auto& out = *new All;
  return out;
}

// Runs when main() returns or exit() is called. Drivers, compilers and the C++ library are torn down after this, and no
// thread may be inside them then.
void JobQueue::end_all() noexcept {
  if (is_forked()) return;  // the threads belong to the parent
  std::set<std::shared_ptr<State>> serving;
  {
    const std::lock_guard lock(all().mutex);
    all().leaving = true;
    serving = all().serving;
  }
  for (const std::shared_ptr<State>& state : serving) {
    std::deque<vsplat_job> jobs;
    {
      const std::lock_guard lock(state->mutex);
      if (state->thread == std::this_thread::get_id()) continue;  // one of its own callbacks has called exit()
      for (vsplat_job job : state->jobs) retain(job), jobs.push_back(job);
      state->ends = true;
      state->changed.notify_all();
    }
    for (vsplat_job job : jobs) {
      const vsplat_status ignored = vsplat_job_cancel(job);  // a failure has no receiver here
      static_cast<void>(ignored);
      vsplat_job_release(job);
    }
    std::unique_lock lock(state->mutex);
    state->changed.wait(lock, [&] { return state->over; });
  }
}

// When a thread calls exit(), its thread_local objects are destroyed first, then atexit() functions run in reverse
// order of registration. A function that a compiler registers while a job compiles would therefore run before ours.
struct JobQueue::FirstThread {
  ~FirstThread() {
    std::error_code problem;  // "PID/task/TID"
    const std::filesystem::path self = std::filesystem::read_symlink("/proc/thread-self", problem);
    if (!problem && !self.empty() && *self.begin() == self.filename()) end_all();
  }
  void watch() {}
};

void JobQueue::watch_this_thread() {
  thread_local FirstThread thread;
  thread.watch();
}

void JobQueue::start_thread(vsplat_device device) {
  const std::lock_guard lock(all().mutex);
  if (all().leaving) fail(Status::cancelled, "the process is exiting: no job can begin any more");
  // Registered for each thread, so that it runs before what this device's driver has registered by now.
  if (std::atexit(end_all) != 0) fail(Status::memory, "not enough host memory");
  all().serving.insert(state_);
  try {
    thread_ = std::thread(serve, state_, device);
    state_->thread = thread_.get_id();
  } catch (...) {
    all().serving.erase(state_);
    throw;
  }
}

void JobQueue::add(vsplat_device device, vsplat_job job) {
  watch_this_thread();
  const std::lock_guard lock(state_->mutex);
  // From the first job to the last, the jobs hold the device.
  if (state_->jobs.empty() && device->in_use.test_and_set(std::memory_order_acquire))
    fail(Status::busy, "the device is in use by another call; a job can begin only when no call uses it");
  try {
    if (!thread_.joinable()) start_thread(device);
    if (state_->ends) fail(Status::cancelled, "the process is exiting: no job can begin any more");
    state_->jobs.push_back(job);
  } catch (...) {
    if (state_->jobs.empty()) device->in_use.clear(std::memory_order_release);
    throw;
  }
  retain(job);
  state_->changed.notify_all();
}

bool JobQueue::borrow(vsplat_device device) {
  if (!device || lent != device) return false;
  lent = nullptr;
  return true;
}

void JobQueue::give_back(vsplat_device device) { lent = device; }

bool JobQueue::is_on_thread_of(vsplat_device device) { return served == device; }

void JobQueue::serve(const std::shared_ptr<State>& given, vsplat_device device) {
  // A copy, since the job may outlive the queue: see ~JobQueue.
  // NOLINTNEXTLINE(performance-unnecessary-copy-initialization)
  const std::shared_ptr<State> state = given;
  served = device;
  run_jobs(*state, device);
  {
    const std::lock_guard lock(all().mutex);
    all().serving.erase(state);
  }
  const std::lock_guard lock(state->mutex);
  state->over = true;
  state->changed.notify_all();
}

void JobQueue::run_jobs(State& state, vsplat_device device) {
  for (;;) {
    vsplat_job job = nullptr;
    {
      std::unique_lock lock(state.mutex);
      state.changed.wait(lock, [&] { return state.ends || !state.jobs.empty(); });
      if (state.jobs.empty()) return;
      job = state.jobs.front();
    }
    vsplat_status status = VSPLAT_ERROR_CANCELLED;
    const char* error = "stopped before it began";
    if (begin(device, *job)) {
      lent = device;
      status = job->run(*job);
      lent = nullptr;
      error = vsplat_last_error();
    }
    end(*job, status, error, [&] {
      const std::lock_guard lock(state.mutex);
      state.jobs.pop_front();
      if (state.jobs.empty()) device->in_use.clear(std::memory_order_release);
    });
    tell_end(*job);
    vsplat_job_release(job);
  }
}

}  // namespace vsplat::api
