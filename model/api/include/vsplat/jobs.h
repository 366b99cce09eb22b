/* Jobs: calls that run beside the program. Included by vsplat.h. A device runs its jobs one after the other, in the
   order in which they were begun, on a thread of its own. Streams of a device run their jobs at the same time. While a
   device has jobs, other calls that use it end with VSPLAT_ERROR_BUSY. A job keeps alive what it uses. The caller that
   began a job releases it, at any time. Jobs that have not ended when main() returns or exit() is called are cancelled,
   and the process waits for their end. */
#ifndef VSPLAT_JOBS_H
#define VSPLAT_JOBS_H

#include <vsplat/device.h>
#include <vsplat/model.h>
#include <vsplat/reconstruct.h>
#include <vsplat/render.h>
#include <vsplat/scene.h>
#include <vsplat/status.h>
#include <vsplat/views.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vsplat_job_impl* vsplat_job;

typedef enum vsplat_job_state {
  VSPLAT_JOB_QUEUED = 1, /* waits for earlier jobs of its device */
  VSPLAT_JOB_RUNNING = 2,
  VSPLAT_JOB_DONE = 3,
  VSPLAT_JOB_FAILED = 4,   /* vsplat_job_result returns why */
  VSPLAT_JOB_CANCELLED = 5 /* by vsplat_job_cancel, or by its progress function */
} vsplat_job_state;

/* Called once, on the device's job thread, when a job has ended and its state and result are available. It may begin
   other jobs. It may not wait for an unfinished job of the same device (VSPLAT_ERROR_BUSY), nor for a thread that waits
   for this job: that would be a deadlock. */
typedef void (*vsplat_job_function)(void* user, vsplat_job job);

typedef struct vsplat_job_options {
  size_t size;
  vsplat_job_function on_end; /* may be NULL */
  void* user;
} vsplat_job_options;
#define VSPLAT_JOB_OPTIONS_INIT \
  { sizeof(vsplat_job_options), NULL, NULL }

/* vsplat_reconstruct as a job; vsplat_job_result returns its scene. What the options point to is copied, except what
   `user` points to. The progress function is called on the device's job thread. `job_options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_reconstruct_async(vsplat_device device, vsplat_model model,
                                                                   vsplat_input input,
                                                                   const vsplat_reconstruct_options* options,
                                                                   const vsplat_job_options* job_options,
                                                                   vsplat_job* out_job);

/* vsplat_render_views as a job. The pictures' arrays belong to the caller and must stay in place until the job has
   ended; after a failure some may be filled. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_render_async(vsplat_device device, vsplat_scene scene,
                                                              const vsplat_camera* cameras, size_t count,
                                                              const vsplat_render_options* options,
                                                              const vsplat_picture* pictures,
                                                              const vsplat_job_options* job_options,
                                                              vsplat_job* out_job);

VSPLAT_API void vsplat_job_retain(vsplat_job job);
VSPLAT_API void vsplat_job_release(vsplat_job job);

/* Waits until the job has ended and its on_end has returned (what on_end uses may then be freed), or until `seconds`
   have passed; 0: only looks; below 0: no limit. Any number of threads may wait. `out_state` is the state on return. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_job_wait(vsplat_job job, double seconds, vsplat_job_state* out_state);

/* Asks the job to stop, from any thread; returns at once. A queued job never begins. A running job ends as
   vsplat_device_cancel describes. A job that has ended is unchanged. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_job_cancel(vsplat_job job);

/* The status that the call would have returned, with its message in vsplat_last_error(). VSPLAT_ERROR_USAGE: the job
   has not ended. `out_scene`, which may be NULL, receives a reference to the reconstructed scene; a render job leaves
   it unchanged. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_job_result(vsplat_job job, vsplat_scene* out_scene);

#ifdef __cplusplus
}
#endif

#endif
