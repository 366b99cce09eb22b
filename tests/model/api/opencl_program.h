/* What the tests of vsplat/opencl.h share: a program with a context and a queue of its own, buffers, a scene and a
   camera. */
#ifndef VSPLAT_TESTS_API_OPENCL_PROGRAM_H
#define VSPLAT_TESTS_API_OPENCL_PROGRAM_H
#include <vsplat/opencl.h>

enum { width = 52, height = 40, pixels = width * height, count = 60, values = 3 * pixels };

#include "ball_scene.h"

typedef struct program {
  cl_context context;
  cl_device_id device;
  cl_command_queue queue;
} program;

/* On the device that the library would choose. */
static program make_program(cl_command_queue_properties properties) {
  vsplat_device device = NULL;
  vsplat_opencl_handles h = VSPLAT_OPENCL_HANDLES_INIT;
  program out = {NULL, NULL, NULL};
  cl_int error = CL_SUCCESS;
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &device));
  EXPECT(VSPLAT_OK, vsplat_opencl_get_handles(device, &h));
  HOLD(h.context && h.device && h.queue);
  out.device = h.device;
  vsplat_device_release(device);
  out.context = clCreateContext(NULL, 1, &out.device, NULL, NULL, &error);
  HOLD(error == CL_SUCCESS);
  out.queue = clCreateCommandQueue(out.context, out.device, properties, &error);
  HOLD(error == CL_SUCCESS);
  return out;
}

static void release_program(program p) {
  clReleaseCommandQueue(p.queue);
  clReleaseContext(p.context);
}

static vsplat_device open_on(program p, int with_queue) {
  vsplat_opencl_handles h = VSPLAT_OPENCL_HANDLES_INIT;
  vsplat_device out = NULL;
  h.context = p.context, h.device = p.device;
  if (with_queue) h.queue = p.queue;
  EXPECT(VSPLAT_OK, vsplat_opencl_open(&h, NULL, &out));
  return out;
}

static cl_mem buffer_of(program p, size_t floats, const float* from) {
  cl_int error = CL_SUCCESS;
  const cl_mem_flags flags = from ? CL_MEM_COPY_HOST_PTR : 0;
  cl_mem out = clCreateBuffer(p.context, CL_MEM_READ_WRITE | flags, floats * sizeof(float), (void*)from, &error);
  HOLD(error == CL_SUCCESS);
  return out;
}

static void read_back(program p, cl_mem from, size_t floats, float* to) {
  HOLD(clEnqueueReadBuffer(p.queue, from, CL_TRUE, 0, floats * sizeof(float), to, 0, NULL, NULL) == CL_SUCCESS);
}

static vsplat_camera make_camera(void) {
  vsplat_camera out = VSPLAT_CAMERA_INIT;
  out.width = width, out.height = height;
  out.fx = out.fy = 80;
  out.cx = width / 2.0, out.cy = height / 2.0;
  return out;
}

#endif
