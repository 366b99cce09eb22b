/* Use with a program's own OpenCL: its context, its queue, its buffers. Not included by vsplat.h; needs the OpenCL
   headers.

   Buffers hold floats, laid out like the arrays of vsplat_picture and vsplat_gaussians. They belong to the device's
   context, else the call ends with VSPLAT_ERROR_USAGE and names the buffer. A buffer that is written may not be
   CL_MEM_READ_ONLY. Their sizes are checked; their contents are the caller's responsibility. For images and memory
   shared with OpenGL, use clEnqueueCopyBufferToImage.

   Where a call takes events, the host waits for them before it enqueues anything, so an event that the same thread
   would complete later is a deadlock. If an event has failed, or fails while waiting, the call ends with
   VSPLAT_ERROR_DEVICE and enqueues nothing. */
#ifndef VSPLAT_OPENCL_H
#define VSPLAT_OPENCL_H

#ifndef CL_TARGET_OPENCL_VERSION
#define CL_TARGET_OPENCL_VERSION 120
#endif
#include <CL/cl.h>
#include <vsplat/vsplat.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vsplat_opencl_handles {
  size_t size;
  cl_context context;
  cl_device_id device;    /* a device that the platform lists, not a sub-device */
  cl_command_queue queue; /* an in-order queue; NULL: the library makes its own in that context */
} vsplat_opencl_handles;
#define VSPLAT_OPENCL_HANDLES_INIT \
  { sizeof(vsplat_opencl_handles), NULL, NULL, NULL }

/* Opens a device on the program's context and queue. Work of the library runs after what the program has enqueued there
   before, and before what it enqueues later. `theirs` are retained while the device is open. The field `device` of the
   options is ignored; NULL: defaults. The profile has device times if the queue was made with
   CL_QUEUE_PROFILING_ENABLE. A stream of the device (vsplat_stream_create) has a queue of the library's own. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_opencl_open(const vsplat_opencl_handles* theirs,
                                                             const vsplat_device_options* options,
                                                             vsplat_device* out_device);

/* The handles of an open device, however it was opened. They are not retained for the caller, and live as long as the
   device. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_opencl_get_handles(vsplat_device device,
                                                                    vsplat_opencl_handles* out_handles);

/* Buffers that a picture is drawn into; NULL for a plane that is not wanted. vsplat_opencl_render needs at least one.
   VSPLAT_ERROR_USAGE: two are equal, or are overlapping sub-buffers. */
typedef struct vsplat_opencl_picture {
  size_t size;
  cl_mem colour; /* [height][width][3] */
  cl_mem alpha;  /* [height][width] */
  cl_mem depth;  /* [height][width] */
  /* Bytes, without the background, laid out like vsplat_picture.data with 8 bits and 4 channels: a buffer of
     [height][width][4], or an image of that size, CL_RGBA with CL_UNORM_INT8 or CL_UNSIGNED_INT8. The host converts
     them from the floats, which it waits for. Only for vsplat_opencl_render */
  cl_mem rgba;
  int32_t premultiplied; /* for rgba; 1: colour is multiplied by alpha; 0: alpha is straight */
} vsplat_opencl_picture;
#define VSPLAT_OPENCL_PICTURE_INIT \
  { sizeof(vsplat_opencl_picture), NULL, NULL, NULL, NULL, 0 }

/* vsplat_render into buffers: equal to the bit, without a copy of the picture. Returns once everything is enqueued. The
   picture is complete when `*out_event` is, which the caller releases, or if `out_event` is NULL, when the queue is
   finished. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_opencl_render(vsplat_device device, vsplat_scene scene,
                                                               const vsplat_camera* camera,
                                                               const vsplat_render_options* options,
                                                               const vsplat_opencl_picture* picture, cl_uint num_events,
                                                               const cl_event* events, cl_event* out_event);

/* Buffers of a scene's arrays for K Gaussians, laid out like vsplat_gaussians, except that surfels have two scales
   each. */
typedef struct vsplat_opencl_gaussians {
  size_t size;
  cl_mem means;     /* [K][3] */
  cl_mem scales;    /* [K][3]; surfels: [K][2] */
  cl_mem rotations; /* [K][4] */
  cl_mem opacities; /* [K] */
  cl_mem sh;        /* [K][S][3] */
} vsplat_opencl_gaussians;
#define VSPLAT_OPENCL_GAUSSIANS_INIT \
  { sizeof(vsplat_opencl_gaussians), NULL, NULL, NULL, NULL, NULL }

/* vsplat_render_backward between buffers. Buffers of `gradient` that are NULL count as zeros; buffers of `out` that are
   NULL are not wanted, but at least one is needed. A written buffer is overwritten, and may share no memory with
   another, nor with `gradient`. The call returns like vsplat_opencl_render, with an event or, `out_event` NULL, without
   one. VSPLAT_ERROR_MEMORY: the scene does not fit on the device as a whole. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_opencl_render_backward(
    vsplat_device device, vsplat_scene scene, const vsplat_camera* camera, const vsplat_render_options* options,
    const vsplat_opencl_picture* gradient, const vsplat_opencl_gaussians* out, cl_uint num_events,
    const cl_event* events, cl_event* out_event);

/* Makes a scene from the values in the caller's buffers, which are read, checked as in vsplat_scene_create, and copied.
   All buffers are needed. `scales` has three values each here, for surfels too. Waits for the events. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_opencl_scene_create(vsplat_device device,
                                                                     const vsplat_scene_info* info,
                                                                     const vsplat_opencl_gaussians* buffers,
                                                                     cl_uint num_events, const cl_event* events,
                                                                     vsplat_scene* out_scene);

/* The buffers that hold the scene on the device; uploads it if necessary. They belong to the library, are not retained,
   and live until another scene is drawn with the device, the device is trimmed, or the scene or the device is freed.
   The caller's kernels, on the device's queue or ordered with it, may read and change them: what the device draws next
   shows the change. The scene itself, and what is saved of it, is unchanged until vsplat_opencl_scene_store copies the
   change back. VSPLAT_ERROR_MEMORY: the scene does not fit on the device as a whole. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_opencl_scene_buffers(vsplat_device device, vsplat_scene scene,
                                                                      vsplat_opencl_gaussians* out_buffers);

/* Reads those buffers back into the scene, and checks the values as vsplat_scene_update does. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_opencl_scene_store(vsplat_device device, vsplat_scene scene);

#ifdef __cplusplus
}
#endif

#endif
