/* What the tests of vsplat/opencl.h share: a program with a context and a queue of its own, buffers, a scene and a
   camera. */
#ifndef VSPLAT_TESTS_API_OPENCL_PROGRAM_H
#define VSPLAT_TESTS_API_OPENCL_PROGRAM_H
#include <vsplat/opencl.h>

#include "checks.h"

enum { width = 52, height = 40, pixels = width * height, count = 60, values = 3 * pixels };

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

static float means[3 * count], scales[3 * count], rotations[4 * count], opacities[count], sh[3 * count];

static vsplat_scene_info scene_info(void) {
  vsplat_scene_info out = VSPLAT_SCENE_INFO_INIT;
  out.count = count;
  return out;
}

static vsplat_scene make_scene(void) {
  const vsplat_scene_info info = scene_info();
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
  vsplat_scene out = NULL;
  int i, c;
  for (i = 0; i < count; ++i) {
    rotations[4 * i] = 1;
    opacities[i] = 0.1f + 0.8f * (float)(i * 31 % 17) / 17;
    for (c = 0; c < 3; ++c) {
      means[3 * i + c] = (float)(i * (919 + 210 * c) % 1000) / 1000 - 0.5f + (c == 2 ? 3.0f : 0.0f);
      scales[3 * i + c] = 0.05f;
      sh[3 * i + c] = (float)((i + 5 * c) % 11) / 5 - 1;
    }
  }
  arrays.capacity = count;
  arrays.means = means, arrays.scales = scales, arrays.rotations = rotations;
  arrays.opacities = opacities, arrays.sh = sh;
  EXPECT(VSPLAT_OK, vsplat_scene_create(&info, &arrays, &out));
  return out;
}

static vsplat_camera make_camera(void) {
  vsplat_camera out = VSPLAT_CAMERA_INIT;
  out.width = width, out.height = height;
  out.fx = out.fy = 80;
  out.cx = width / 2.0, out.cy = height / 2.0;
  return out;
}

#endif
