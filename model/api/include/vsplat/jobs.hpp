// Jobs for C++, see vsplat/jobs.h. Part of vsplat.hpp, which includes this file.
#ifndef VSPLAT_JOBS_HPP
#define VSPLAT_JOBS_HPP

#include <functional>
#include <memory>
#include <utility>
#include <vector>
#include <vsplat/vsplat.hpp>

namespace vsplat {
inline namespace cxx {

using JobHandle = Handle<vsplat_job, vsplat_job_retain, vsplat_job_release>;

// Functions called while a job runs, on the device's job thread; both may be empty.
struct JobFunctions {
  Progress progress;
  std::function<void()> on_end;  // called once, when the job has ended; may begin other jobs, and may not throw
};

namespace detail {

// Owned by the job until it has ended, and by its Job handles.
struct JobCalls {
  JobFunctions functions;
  Caught caught;

  static int32_t on_progress(void* user, const char* stage, double done) {
    JobCalls& self = **static_cast<std::shared_ptr<JobCalls>*>(user);
    bool on = false;
    self.caught.run([&] { on = self.functions.progress(stage, done); });
    return on ? 1 : 0;
  }
  static void on_end(void* user, vsplat_job) {
    const std::unique_ptr<std::shared_ptr<JobCalls>> kept(static_cast<std::shared_ptr<JobCalls>*>(user));
    if ((*kept)->functions.on_end) (*kept)->functions.on_end();
  }
};

}  // namespace detail

class Job : public JobHandle {
 public:
  Job() = default;
  Job(vsplat_job owned, std::shared_ptr<detail::JobCalls> calls) : JobHandle(owned), calls_(std::move(calls)) {}

  vsplat_job_state state() const { return wait(0); }
  // Waits until the job has ended and on_end has returned, or for `seconds`. Returns the state it then has.
  vsplat_job_state wait(double seconds = -1) const {
    vsplat_job_state out = VSPLAT_JOB_QUEUED;
    check(vsplat_job_wait(get(), seconds, &out));
    return out;
  }
  void cancel() const { check(vsplat_job_cancel(get())); }
  // Waits, and throws the job's failure: Error, or what its progress function threw.
  void finish() const {
    wait();
    calls_->caught.check(vsplat_job_result(get(), nullptr));
  }
  // Like finish(), for a reconstruction. Returns its scene.
  Scene scene() const {
    wait();
    vsplat_scene out = nullptr;
    calls_->caught.check(vsplat_job_result(get(), &out));
    return Scene(out);
  }

 private:
  std::shared_ptr<detail::JobCalls> calls_;
};

namespace detail {

// `begin(options with progress and user set, job options, out)` begins the job.
template <class Options, class Begin>
Job begin_job(Options options, JobFunctions functions, const Begin& begin) {
  auto calls = std::make_shared<JobCalls>();
  calls->functions = std::move(functions);
  auto kept = std::make_unique<std::shared_ptr<JobCalls>>(calls);
  if (calls->functions.progress) {
    options.progress = JobCalls::on_progress;
    options.user = kept.get();
  }
  vsplat_job_options job_options = VSPLAT_JOB_OPTIONS_INIT;
  job_options.on_end = JobCalls::on_end;
  job_options.user = kept.get();
  vsplat_job out = nullptr;
  // on_end, which may run before this returns, frees `kept`; if the job never begins, it is freed here.
  auto* const given = kept.release();
  const vsplat_status status = begin(options, job_options, &out);
  if (status != VSPLAT_OK) kept.reset(given);
  check(status);
  return Job(out, std::move(calls));
}

}  // namespace detail

inline Job reconstruct_async(const Device& device, const Model& model, const Input& input,
                             const vsplat_reconstruct_options& options = VSPLAT_RECONSTRUCT_OPTIONS_INIT,
                             JobFunctions functions = {}) {
  return detail::begin_job(options, std::move(functions), [&](const auto& o, const auto& job, vsplat_job* out) {
    return vsplat_reconstruct_async(device.get(), model.get(), input.get(), &o, &job, out);
  });
}

// Draws one picture for each camera. The pictures' memory belongs to the caller, and must stay in place until the job
// has ended.
inline Job render_async(const Device& device, const Scene& scene, Span<const vsplat_camera> cameras,
                        Span<const PictureSpans> pictures,
                        const vsplat_render_options& options = VSPLAT_RENDER_OPTIONS_INIT,
                        JobFunctions functions = {}) {
  const std::vector<vsplat_picture> arrays = detail::arrays_of(cameras, pictures);
  return detail::begin_job(options, std::move(functions), [&](const auto& o, const auto& job, vsplat_job* out) {
    return vsplat_render_async(device.get(), scene.get(), cameras.data(), cameras.size(), &o, arrays.data(), &job, out);
  });
}

}  // namespace cxx
}  // namespace vsplat

#endif
