// Jobs of a device: calls that run one after the other on a thread of the device's own.
#pragma once
#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "model/api/handle.h"

struct vsplat_job_impl : vsplat::api::Counted {
  ~vsplat_job_impl();

  vsplat::api::HandleRef<vsplat_device, vsplat_device_retain, vsplat_device_release> device;
  std::function<vsplat_status(vsplat_job_impl&)> run;  // cleared when it has run, with all that it keeps alive
  vsplat_job_function on_end = nullptr;
  void* user = nullptr;

  std::mutex mutex;  // guards the members below
  std::condition_variable changed;
  vsplat_job_state state = VSPLAT_JOB_QUEUED;
  bool asked_to_stop = false;
  bool end_reported = false;  // on_end has returned, and vsplat_job_wait may return
  vsplat_status status = VSPLAT_OK;
  std::string error;             // message if it failed
  vsplat_scene scene = nullptr;  // result of a reconstruction
};

namespace vsplat::api {

class JobQueue {
 public:
  JobQueue() : state_(std::make_shared<State>()) {}
  // No job is left, since each keeps its device alive.
  ~JobQueue();
  JobQueue(const JobQueue&) = delete;
  JobQueue& operator=(const JobQueue&) = delete;

  // Takes a reference to the job. Error(busy) if a call that is not one of its jobs holds the device. Error(cancelled)
  // once the process exits: running jobs are then cancelled, and exit waits for them.
  void add(vsplat_device device, vsplat_job job);

  // For the call that a job makes on its thread: returns whether it may use the device through the job. give_back()
  // ends that.
  static bool borrow(vsplat_device device);
  static void give_back(vsplat_device device);
  // Whether this is that device's job thread.
  static bool is_on_thread_of(vsplat_device device);
  // If this is the process's first thread, its end ends the jobs: see end_all().
  static void watch_this_thread();

 private:
  struct State {
    std::mutex mutex;
    std::condition_variable changed;
    std::deque<vsplat_job> jobs;  // the first may be running
    bool ends = false;
    bool over = false;  // the thread is finished
    std::thread::id thread;
  };
  struct All;  // all queues in the process that have a thread
  struct FirstThread;
  static All& all();
  static void serve(const std::shared_ptr<State>& state, vsplat_device device);
  static void run_jobs(State& state, vsplat_device device);
  void start_thread(vsplat_device device);
  static void end_all() noexcept;

  std::shared_ptr<State> state_;
  std::thread thread_;
};

}  // namespace vsplat::api
