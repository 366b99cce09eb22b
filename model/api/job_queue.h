// Jobs of a device: calls that run on a thread of the device's own, one after the other.
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

  vsplat::api::Kept<vsplat_device, vsplat_device_retain, vsplat_device_release> device;
  std::function<vsplat_status(vsplat_job_impl&)> run;  // gone when it has run, and with it what it keeps alive
  vsplat_job_function on_end = nullptr;
  void* user = nullptr;

  std::mutex mutex;  // of what follows
  std::condition_variable changed;
  vsplat_job_state state = VSPLAT_JOB_QUEUED;
  bool told_to_stop = false;
  bool told_its_end = false;  // on_end has returned; who waits then waits no longer
  vsplat_status status = VSPLAT_OK;
  std::string error;             // the sentence of its failure
  vsplat_scene scene = nullptr;  // made by a reconstruction
};

namespace vsplat::api {

class JobQueue {
 public:
  JobQueue() : state_(std::make_shared<State>()) {}
  // No job is left: each keeps its device alive.
  ~JobQueue();
  JobQueue(const JobQueue&) = delete;
  JobQueue& operator=(const JobQueue&) = delete;

  // Takes a reference of it. Error(busy) where a call has the device that is none of its jobs. Error(cancelled) once
  // the process exits: what runs then is cancelled, and waited for.
  void add(vsplat_device device, vsplat_job job);

  // For the one call that a job makes, on its thread: whether it has the device by its job; give_back() at its end.
  static bool borrow(vsplat_device device);
  static void give_back(vsplat_device device);
  // Whether this is the thread of that device's jobs.
  static bool is_on_thread_of(vsplat_device device);
  // The end of this thread ends the jobs where it is the process's first one: see end_all().
  static void watch_this_thread();

 private:
  struct State {
    std::mutex mutex;
    std::condition_variable changed;
    std::deque<vsplat_job> jobs;  // the first one may be running
    bool ends = false;
    bool over = false;  // the thread has done with everything
    std::thread::id thread;
  };
  struct All;  // that have a thread, in the process
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
