/* vsplat: four posed photos in, a 3D Gaussian splat and novel views out, on any OpenCL device.

   How to read this header
   - Handles are opaque and counted: a call that makes one gives it to the caller with a count of one;
     vsplat_<noun>_retain adds one, vsplat_<noun>_release takes one away and frees at zero. Releasing NULL does nothing.
     A handle keeps alive whatever it was made from.
   - Every other call returns a status; results go through the trailing out_ pointers, which are written on success
   only. Bad input leaves every object as it was. vsplat_last_error() holds the sentence for a person, per thread.
   - Structs begin with their size: fill them from their _INIT macro, then set what you need. A library that is newer or
     older than the caller takes the fields that both know. In an array of structs the first one's size is the stride.
   Options that are NULL are all defaults, but where a call has no defaults for them and says so.
   - Cameras: OpenCV axes (x right, y down, z forward), pixels with centres at +0.5, matrices row-major, world to
     camera. In files they are as the file's format has them: a transforms.json leads from the camera to the world, in
     OpenGL's axes (x right, y up, z backward). FORMATS.md of the documents has every format and convention.
   - Pictures: [height][width][channels] float, colour sRGB-encoded in [0,1].
   - Text that a call hands out (char** out_text) is freed with vsplat_text_free.
   - Text that goes in is UTF-8, ended by NUL, and only read during the call.
   - Threads: different devices, and streams of one (vsplat_stream_create), may be used by different threads at the same
     time; calls that take the same one, or a handle made with it, one at a time: a call that finds the device taken ends
     at once with VSPLAT_ERROR_BUSY, and so does one from a callback of the call that has it. Not taken is it by
     vsplat_device_get_info, vsplat_opencl_get_handles, vsplat_stream_create, vsplat_device_cancel, and what retains and
     releases. Handles that belong to no
     device (model, views, cameras, scene) may be read by several threads. Calls block until their result is there, but
     for those that begin a job (vsplat/jobs.h); another thread may stop them (vsplat_device_cancel). Callbacks come on
     the calling thread, but for those of work that several devices share (vsplat/share.h).
   - Drivers do not live on in a child of fork(): there, calls that take a device end with VSPLAT_ERROR_DEVICE.
   - From 0.N.a to 0.N.b this interface only grows; with 1.0, within a major version. */
#ifndef VSPLAT_H
#define VSPLAT_H

#include <vsplat/dataset.h>
#include <vsplat/device.h>
#include <vsplat/doctor.h>
#include <vsplat/evaluate.h>
#include <vsplat/jobs.h>
#include <vsplat/model.h>
#include <vsplat/pictures.h>
#include <vsplat/programs.h>
#include <vsplat/ranks.h>
#include <vsplat/reconstruct.h>
#include <vsplat/refine.h>
#include <vsplat/render.h>
#include <vsplat/report.h>
#include <vsplat/scene.h>
#include <vsplat/selftest.h>
#include <vsplat/share.h>
#include <vsplat/status.h>
#include <vsplat/train.h>
#include <vsplat/tune.h>
#include <vsplat/views.h>

#endif
