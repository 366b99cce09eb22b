/* Beside a program's own OpenCL: its context, its queue, its buffers. Not included by vsplat.h; needs OpenCL's
   headers.

   Buffers hold floats, laid out as the arrays of vsplat_picture and vsplat_gaussians are. They belong to the
   context of the device, else the call ends with VSPLAT_ERROR_USAGE and names the buffer; one that is written may
   not be CL_MEM_READ_ONLY. Their sizes are checked; what is in them is the caller's to answer for. Images and
   what is shared with OpenGL go through clEnqueueCopyBufferToImage. Where a call takes events, the host waits for
   them before it enqueues anything: an event that the same thread completes later would not end. Where one has
   failed, or fails meanwhile, the call ends with VSPLAT_ERROR_DEVICE and enqueues nothing. */
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
  cl_device_id device;    /* one that the platform lists; no part of one */
  cl_command_queue queue; /* in order; NULL: one of the library's own, in that context */
} vsplat_opencl_handles;
#define VSPLAT_OPENCL_HANDLES_INIT \
  { sizeof(vsplat_opencl_handles), NULL, NULL, NULL }

/* Opens a device on the program's context, and on its queue: what the library enqueues comes after what the
   program has enqueued there, and before what it enqueues later. `theirs` are retained while the device is open.
   Of the options `device` is not looked at; NULL: defaults. The profile has the device's times where the queue
   was made with CL_QUEUE_PROFILING_ENABLE. A stream of the device (vsplat_stream_create) has a queue of the
   library's. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_opencl_open(const vsplat_opencl_handles* theirs,
                                                             const vsplat_device_options* options,
                                                             vsplat_device* out_device);

/* The handles of an open device, however it was opened. They are not retained for the caller: they live as long
   as the device. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_opencl_get_handles(vsplat_device device,
                                                                    vsplat_opencl_handles* out_handles);

/* Buffers that a picture is drawn into; any of them NULL where not wanted. vsplat_opencl_render needs at least one. No
   two may be the same, or parts of one that overlap: else VSPLAT_ERROR_USAGE. */
typedef struct vsplat_opencl_picture {
  size_t size;
  cl_mem colour; /* [height][width][3] */
  cl_mem alpha;  /* [height][width] */
  cl_mem depth;  /* [height][width] */
  /* Bytes, without the background, as vsplat_picture.data has them with 8 bits and 4 channels: a buffer of
     [height][width][4], or an image of that size, CL_RGBA with CL_UNORM_INT8 or CL_UNSIGNED_INT8. The host makes them of
     the floats, and waits for these. Of vsplat_opencl_render alone */
  cl_mem rgba;
  int32_t premultiplied; /* of rgba: 1: colour is multiplied by alpha; 0: alpha is straight */
} vsplat_opencl_picture;
#define VSPLAT_OPENCL_PICTURE_INIT \
  { sizeof(vsplat_opencl_picture), NULL, NULL, NULL, NULL, 0 }

/* vsplat_render into buffers: the same bits, with no copy of the picture. Returns when all is enqueued: the
   picture is there when `*out_event` is complete, which the caller releases, or where `out_event` is NULL, when
   the queue is finished. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_opencl_render(vsplat_device device, vsplat_scene scene,
                                                               const vsplat_camera* camera,
                                                               const vsplat_render_options* options,
                                                               const vsplat_opencl_picture* picture, cl_uint num_events,
                                                               const cl_event* events, cl_event* out_event);

/* Buffers of a scene's arrays, K Gaussians, as vsplat_gaussians has them, but for surfels: two scales each. */
typedef struct vsplat_opencl_gaussians {
  size_t size;
  cl_mem means;     /* [K][3] */
  cl_mem scales;    /* [K][3], of surfels [K][2] */
  cl_mem rotations; /* [K][4] */
  cl_mem opacities; /* [K] */
  cl_mem sh;        /* [K][S][3] */
} vsplat_opencl_gaussians;
#define VSPLAT_OPENCL_GAUSSIANS_INIT \
  { sizeof(vsplat_opencl_gaussians), NULL, NULL, NULL, NULL, NULL }

/* vsplat_render_backward from buffers into buffers: those of `gradient` that are NULL count as zeros, those of
   `out` that are NULL are not wanted, one at least is; what is written replaces what was there, and may share no
   memory with another, nor with `gradient`. Returns, and has an event or,
   `out_event` NULL, none, as vsplat_opencl_render. VSPLAT_ERROR_MEMORY where the scene does not lie on the device
   whole. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_opencl_render_backward(
    vsplat_device device, vsplat_scene scene, const vsplat_camera* camera, const vsplat_render_options* options,
    const vsplat_opencl_picture* gradient, const vsplat_opencl_gaussians* out, cl_uint num_events,
    const cl_event* events, cl_event* out_event);

/* A scene of the values in the caller's buffers, which are read, checked as vsplat_scene_create checks, and
   copied; of surfels, too, `scales` has three each here. All are needed. Waits for the events. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_opencl_scene_create(vsplat_device device,
                                                                     const vsplat_scene_info* info,
                                                                     const vsplat_opencl_gaussians* buffers,
                                                                     cl_uint num_events, const cl_event* events,
                                                                     vsplat_scene* out_scene);

/* The buffers in which the scene lies on the device, put there where it does not yet: the library's, not
   retained, there until another scene is drawn with the device, or it is trimmed, or one of the two goes. The
   caller's kernels, on the device's queue or ordered with it, may read them and may change them: what the device
   draws next shows the change. The scene itself stays as it was, and so does what is saved of it, until
   vsplat_opencl_scene_store takes the change over. VSPLAT_ERROR_MEMORY where the scene does not lie on the device
   whole. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_opencl_scene_buffers(vsplat_device device, vsplat_scene scene,
                                                                      vsplat_opencl_gaussians* out_buffers);

/* Reads those buffers back into the scene, and checks them as vsplat_scene_update does. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_opencl_scene_store(vsplat_device device, vsplat_scene scene);

#ifdef __cplusplus
}
#endif

#endif
