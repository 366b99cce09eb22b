// Calls that run beside the program.
#include <chrono>
#include <memory>
#include <optional>
#include <vector>

#include "model/api/device.h"
#include "model/api/input.h"
#include "model/api/job_queue.h"
#include "model/api/scene.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

using ModelRef = HandleRef<vsplat_model, vsplat_model_retain, vsplat_model_release>;
using InputRef = HandleRef<vsplat_input, vsplat_input_retain, vsplat_input_release>;
using SceneRef = HandleRef<vsplat_scene, vsplat_scene_retain, vsplat_scene_release>;

// A copy of a reconstruction's options with all that they point to.
class OwnOptions {
 public:
  explicit OwnOptions(const vsplat_reconstruct_options& from)
      : options_(from), selection_(text(from.selection)), dump_(text(from.dump)) {
    need_array(from.voxels, from.num_voxels, "options.voxels");
    if (from.voxels) voxels_.emplace(from.voxels, from.voxels + from.num_voxels);
  }
  // Valid while this object lives: they point into it.
  vsplat_reconstruct_options get() const {
    vsplat_reconstruct_options out = options_;
    out.voxels = voxels_ ? voxels_->data() : nullptr;
    out.selection = selection_ ? selection_->c_str() : nullptr;
    out.dump = dump_ ? dump_->c_str() : nullptr;
    return out;
  }

 private:
  static std::optional<std::string> text(const char* from) {
    return from ? std::optional<std::string>(from) : std::nullopt;
  }

  vsplat_reconstruct_options options_;
  std::optional<std::vector<int32_t>> voxels_;
  std::optional<std::string> selection_, dump_;
};

template <class Run>
vsplat_job begun(vsplat_device device, const vsplat_job_options* options, Run run) {
  const vsplat_job_options o = taken(options, VSPLAT_JOB_OPTIONS_INIT, "job_options");
  refuse_after_fork();
  auto job = std::make_unique<vsplat_job_impl>();
  job->device = device;
  job->on_end = o.on_end;
  job->user = o.user;
  job->run = std::move(run);
  device->jobs.add(device, job.get());
  return job.release();
}

}  // namespace

vsplat_status vsplat_reconstruct_async(vsplat_device device, vsplat_model model, vsplat_input input,
                                       const vsplat_reconstruct_options* options, const vsplat_job_options* job_options,
                                       vsplat_job* out_job) {
  return guarded([&] {
    need(device, "device");
    need(model, "model");
    need(input, "input");
    need(out_job, "out_job");
    const auto own = std::make_shared<const OwnOptions>(taken(options, VSPLAT_RECONSTRUCT_OPTIONS_INIT, "options"));
    *out_job = begun(device, job_options,
                     [device, own, model = ModelRef(model), input = InputRef(input)](vsplat_job_impl& job) {
                       const vsplat_reconstruct_options o = own->get();
                       return vsplat_reconstruct(device, model.get(), input.get(), &o, &job.scene);
                     });
  });
}

vsplat_status vsplat_render_async(vsplat_device device, vsplat_scene scene, const vsplat_camera* cameras, size_t count,
                                  const vsplat_render_options* options, const vsplat_picture* pictures,
                                  const vsplat_job_options* job_options, vsplat_job* out_job) {
  return guarded([&] {
    need(device, "device");
    need(scene, "scene");
    need_structs(cameras, count, "cameras");
    need_structs(pictures, count, "pictures");
    need(out_job, "out_job");
    std::vector<vsplat_camera> shots;
    std::vector<vsplat_picture> outputs;
    for (size_t i = 0; i < count; ++i) {
      shots.push_back(taken(&element(cameras, i, "cameras"), VSPLAT_CAMERA_INIT, "cameras"));
      outputs.push_back(taken(&element(pictures, i, "pictures"), VSPLAT_PICTURE_INIT, "pictures"));
    }
    const vsplat_render_options o = taken(options, VSPLAT_RENDER_OPTIONS_INIT, "options");
    *out_job = begun(
        device, job_options,
        [device, o, scene = SceneRef(scene), shots = std::move(shots), outputs = std::move(outputs)](vsplat_job_impl&) {
          return vsplat_render_views(device, scene.get(), shots.data(), shots.size(), &o, outputs.data());
        });
  });
}

void vsplat_job_retain(vsplat_job job) { retain(job); }
void vsplat_job_release(vsplat_job job) {
  if (!is_forked()) release(job);  // as in vsplat_device_release()
}

vsplat_status vsplat_job_wait(vsplat_job job, double seconds, vsplat_job_state* out_state) {
  return guarded([&] {
    need(job, "job");
    need(out_state, "out_state");
    refuse_after_fork();
    std::unique_lock lock(job->mutex);
    const auto has_ended = [&] { return job->state != VSPLAT_JOB_QUEUED && job->state != VSPLAT_JOB_RUNNING; };
    const bool on_its_thread = JobQueue::is_on_thread_of(job->device.get());
    if (seconds != 0 && !has_ended() && on_its_thread)
      fail(Status::busy, "the job waits for this callback to return, since both belong to the same device");
    // The caller may free what on_end uses once this returns, so wait for on_end too; a job's own callback cannot wait
    // for itself.
    const auto is_over = [&] { return has_ended() && (on_its_thread || job->end_reported); };
    constexpr double most = 1e9;  // a generation, and within the range of clocks
    if (seconds < 0)
      job->changed.wait(lock, is_over);
    else
      job->changed.wait_for(lock, std::chrono::duration<double>(seconds < most ? seconds : most), is_over);
    *out_state = job->state;
  });
}

vsplat_status vsplat_job_cancel(vsplat_job job) {
  return guarded([&] {
    need(job, "job");
    const std::lock_guard lock(job->mutex);
    job->asked_to_stop = true;
    if (job->state == VSPLAT_JOB_RUNNING) job->device.get()->context.cancel();
  });
}

vsplat_status vsplat_job_result(vsplat_job job, vsplat_scene* out_scene) {
  return guarded([&] {
    need(job, "job");
    const std::lock_guard lock(job->mutex);
    if (job->state == VSPLAT_JOB_QUEUED || job->state == VSPLAT_JOB_RUNNING)
      fail(Status::usage, "the job has not ended: vsplat_job_wait waits for it");
    if (job->status != VSPLAT_OK) throw Error(static_cast<Status>(job->status), job->error);
    if (out_scene && job->scene) {
      vsplat_scene_retain(job->scene);
      *out_scene = job->scene;
    }
  });
}
