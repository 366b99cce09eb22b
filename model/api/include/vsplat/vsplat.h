/* vsplat: four posed photos in, a 3D Gaussian splat and novel views out, on any OpenCL device.

   Conventions
   - Handles are opaque and reference-counted. A call that makes a handle returns it with a count of one;
     vsplat_<noun>_retain increments the count; vsplat_<noun>_release decrements it and frees at zero. Releasing NULL
     does nothing. A handle keeps alive whatever it was made from.
   - Every other call returns a status. Results go through the trailing out_ pointers, which are written only on
     success. A call that fails on bad input leaves every object unchanged. vsplat_last_error() holds the thread's error
     message.
   - Structs begin with their size: initialise them from their _INIT macro, then set what you need. A library that is
     newer or older than the caller uses the fields that both know. In an array of structs, the first struct's size is
     the stride. NULL options mean defaults, unless the call says that it needs them.
   - Cameras: OpenCV axes (x right, y down, z forward), pixel centres at +0.5, matrices row-major, world to camera.
     Files follow their format's conventions: a transforms.json maps from the camera to the world, in OpenGL axes
     (x right, y up, z backward). FORMATS.md of the documents describes every format and convention.
   - Pictures: [height][width][channels] float, colour sRGB-encoded in [0,1].
   - Text that a call returns (char** out_text) is freed with vsplat_text_free.
   - Text arguments are NUL-terminated UTF-8, and are only read during the call.
   - Threads: different devices, and different streams of one device (vsplat_stream_create), may be used by different
     threads at the same time. Calls that use the same device or stream, or a handle made with it, must come one at a
     time: a call that finds the device in use ends at once with VSPLAT_ERROR_BUSY, and so does one from a callback of
     the call that uses it. These calls do not use the device in this sense: vsplat_device_get_info,
     vsplat_opencl_get_handles, vsplat_stream_create, vsplat_device_cancel, and all that retain and release. Several
     threads may read handles that belong to no device (model, views, cameras, scene). Calls block until their result is
     complete, except those that begin a job (vsplat/jobs.h); another thread may stop them (vsplat_device_cancel).
     Callbacks run on the calling thread, except those of work shared by several devices (vsplat/share.h).
   - OpenCL drivers do not survive fork(): in a child process, calls that use a device end with VSPLAT_ERROR_DEVICE.
   - From 0.N.a to 0.N.b this interface only grows; from 1.0 on, within a major version. */
#ifndef VSPLAT_H
#define VSPLAT_H

#include <vsplat/dataset.h>
#include <vsplat/device.h>
#include <vsplat/doctor.h>
#include <vsplat/evaluate.h>
#include <vsplat/fit.h>
#include <vsplat/jobs.h>
#include <vsplat/mesh.h>
#include <vsplat/model.h>
#include <vsplat/pictures.h>
#include <vsplat/programs.h>
#include <vsplat/ranks.h>
#include <vsplat/reconstruct.h>
#include <vsplat/render.h>
#include <vsplat/report.h>
#include <vsplat/scene.h>
#include <vsplat/scene_edit.h>
#include <vsplat/selftest.h>
#include <vsplat/share.h>
#include <vsplat/status.h>
#include <vsplat/train.h>
#include <vsplat/tune.h>
#include <vsplat/views.h>

#endif
