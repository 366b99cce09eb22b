/* Draws frames of a large scene into a caller's buffer: `frames_test SCENE.ply CAMERAS.json [FRAMES]` (1000). No
   picture passes through the host, each equals vsplat_render's result on the host, and there is hardly any time
   beside the kernels' own. */
#include <CL/cl.h>
#include <stdlib.h>
#include <time.h>
#include <vsplat/opencl.h>

#include "checks.h"

enum { MOST_CAMERAS = 64 };

static vsplat_camera cameras[MOST_CAMERAS];
static size_t count = 0;

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int load_cameras(const char* path) {
  vsplat_cameras list = NULL;
  size_t i;
  EXPECT(VSPLAT_OK, vsplat_cameras_load(path, 0, 0, &list));
  EXPECT(VSPLAT_OK, vsplat_cameras_count(list, &count));
  if (count > MOST_CAMERAS) count = MOST_CAMERAS;
  for (i = 0; i < count; ++i) {
    const vsplat_camera none = VSPLAT_CAMERA_INIT;
    cameras[i] = none;
    EXPECT(VSPLAT_OK, vsplat_cameras_get(list, i, &cameras[i]));
  }
  vsplat_cameras_release(list);
  return count > 0;
}

static void draw(vsplat_device device, vsplat_scene scene, cl_mem colour, size_t camera) {
  vsplat_opencl_picture picture = VSPLAT_OPENCL_PICTURE_INIT;
  picture.colour = colour;
  EXPECT(VSPLAT_OK, vsplat_opencl_render(device, scene, &cameras[camera], NULL, &picture, 0, NULL, NULL));
}

static void as_on_the_host(vsplat_device device, vsplat_scene scene, cl_command_queue queue, cl_mem colour) {
  const size_t floats = 3 * (size_t)cameras[0].width * (size_t)cameras[0].height;
  float *want = malloc(floats * sizeof *want), *got = malloc(floats * sizeof *got);
  size_t i;
  for (i = 0; i < count && want && got; ++i) {
    vsplat_picture picture = VSPLAT_PICTURE_INIT;
    picture.capacity = floats / 3, picture.colour = want;
    EXPECT(VSPLAT_OK, vsplat_render(device, scene, &cameras[i], NULL, &picture));
    draw(device, scene, colour, i);
    HOLD(clEnqueueReadBuffer(queue, colour, CL_TRUE, 0, floats * sizeof *got, got, 0, NULL, NULL) == CL_SUCCESS);
    HOLD(memcmp(want, got, floats * sizeof *got) == 0);
    HOLD(want[0] != want[floats / 2] || want[1] != want[floats / 2 + 1]);
  }
  free(want);
  free(got);
}

static void frames(vsplat_device device, vsplat_scene scene, cl_command_queue queue, cl_mem colour, long n) {
  const double picture = 12.0 * cameras[0].width * cameras[0].height;
  double begun, wall, kernels = 0, copied = 0;
  size_t rows = 0, i;
  long at;
  EXPECT(VSPLAT_OK, vsplat_device_profile(device, 1));
  begun = now();
  for (at = 0; at < n; ++at) draw(device, scene, colour, (size_t)at % count);
  HOLD(clFinish(queue) == CL_SUCCESS);
  wall = now() - begun;
  EXPECT(VSPLAT_OK, vsplat_device_profile_count(device, &rows));
  for (i = 0; i < rows; ++i) {
    vsplat_profile_row row = VSPLAT_PROFILE_ROW_INIT;
    EXPECT(VSPLAT_OK, vsplat_device_profile_get(device, i, &row));
    if (strcmp(row.stage, "transfer") == 0)
      copied += row.bytes;
    else
      kernels += row.seconds;
  }
  EXPECT(VSPLAT_OK, vsplat_device_profile(device, 0));
  printf("%ld frames in %.2f s, %.2f ms each: %.4f times the kernels' %.2f s; %.0f bytes copied a frame\n", n, wall,
         1e3 * wall / (double)n, wall / kernels, kernels, copied / (double)n);
  HOLD(copied < 1e-3 * picture * (double)n); /* the host only reads the number of visible Gaussians */
  HOLD(wall <= 1.05 * kernels);
}

int main(int argc, char** argv) {
  vsplat_opencl_handles h = VSPLAT_OPENCL_HANDLES_INIT;
  vsplat_device device = NULL;
  vsplat_scene scene = NULL;
  cl_mem colour = NULL;
  if (argc < 3 || !load_cameras(argv[2])) return 2;
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &device));
  EXPECT(VSPLAT_OK, vsplat_opencl_get_handles(device, &h));
  EXPECT(VSPLAT_OK, vsplat_scene_load(argv[1], &scene));
  colour = clCreateBuffer(h.context, CL_MEM_READ_WRITE, 12 * (size_t)cameras[0].width * (size_t)cameras[0].height, NULL,
                          NULL);
  HOLD(colour);
  if (!failures) {
    as_on_the_host(device, scene, h.queue, colour);
    frames(device, scene, h.queue, colour, argc > 3 ? atol(argv[3]) : 1000);
  }
  if (colour) clReleaseMemObject(colour);
  vsplat_scene_release(scene);
  vsplat_device_release(device);
  return failures != 0;
}
