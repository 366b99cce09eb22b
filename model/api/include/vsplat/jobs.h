/* Jobs: calls that run beside the program. Included by vsplat.h.

   A device runs its jobs one after the other, in the order in which they were begun, on a thread of its own;
   streams of a device run theirs at the same time. While a device has jobs, other calls that take it end with
   VSPLAT_ERROR_BUSY. A job keeps alive what it uses. Whoever begins one releases it, at any time. Jobs that have not ended when main()
   returns or exit() is called are cancelled, and the process waits until they have ended. */
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
  VSPLAT_JOB_QUEUED = 1, /* others of its device go first */
  VSPLAT_JOB_RUNNING = 2,
  VSPLAT_JOB_DONE = 3,
  VSPLAT_JOB_FAILED = 4,   /* vsplat_job_result says why */
  VSPLAT_JOB_CANCELLED = 5 /* by vsplat_job_cancel, or by its progress function */
} vsplat_job_state;

/* Called once, on the device's thread of jobs, when a job has ended: its state and result are there. It may begin other
   jobs; it may not wait for one of the same device that has not ended (VSPLAT_ERROR_BUSY), nor for a thread that waits
   for this job, which waits for it. */
typedef void (*vsplat_job_function)(void* user, vsplat_job job);

typedef struct vsplat_job_options {
  size_t size;
  vsplat_job_function on_end; /* NULL: none */
  void* user;
} vsplat_job_options;
#define VSPLAT_JOB_OPTIONS_INIT \
  { sizeof(vsplat_job_options), NULL, NULL }

/* vsplat_reconstruct as a job: its scene comes from vsplat_job_result. What the options point to is copied, but
   for what `user` points to; the progress function is called on the device's thread of jobs. `job_options` NULL:
   defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_reconstruct_async(vsplat_device device, vsplat_model model,
                                                                   vsplat_input input,
                                                                   const vsplat_reconstruct_options* options,
                                                                   const vsplat_job_options* job_options,
                                                                   vsplat_job* out_job);

/* vsplat_render_views as a job. The arrays of the pictures are the caller's and stay where they are until it has
   ended; after a failure some may be filled. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_render_async(vsplat_device device, vsplat_scene scene,
                                                              const vsplat_camera* cameras, size_t count,
                                                              const vsplat_render_options* options,
                                                              const vsplat_picture* pictures,
                                                              const vsplat_job_options* job_options,
                                                              vsplat_job* out_job);

VSPLAT_API void vsplat_job_retain(vsplat_job job);
VSPLAT_API void vsplat_job_release(vsplat_job job);

/* Waits until the job has ended and its on_end has returned, so that what that uses may go; and no longer than so many
   seconds: 0 only looks, below 0 there is no limit. Any thread, any number of them. `out_state` is what it is then. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_job_wait(vsplat_job job, double seconds, vsplat_job_state* out_state);

/* Tells it to stop, from any thread; returns at once. One that has not begun never does; one that is running ends as
   vsplat_device_cancel says. One that has ended stays as it is. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_job_cancel(vsplat_job job);

/* The status that the call would have returned, with its sentence in vsplat_last_error(); VSPLAT_ERROR_USAGE for
   a job that has not ended. `out_scene`, which may be NULL, takes a count of the scene that was reconstructed;
   for a drawing it is left as it is. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_job_result(vsplat_job job, vsplat_scene* out_scene);

#ifdef __cplusplus
}
#endif

#endif
