/* A program that uses OpenCL beside the library, in plain C: its context and queue, pictures and gradients in its
   buffers, its kernel on the library's buffers. Prints every check that fails; exits 1 if any did. */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "opencl_program.h"

static const char* const doubling = "kernel void twice(global float* x) { x[get_global_id(0)] *= 2; }";

typedef struct pictures {
  float colour[values], alpha[pixels], depth[pixels];
} pictures;

static void draw_to_host(vsplat_device device, vsplat_scene scene, pictures* out) {
  const vsplat_camera camera = make_camera();
  vsplat_picture picture = VSPLAT_PICTURE_INIT;
  picture.capacity = pixels;
  picture.colour = out->colour, picture.alpha = out->alpha, picture.depth = out->depth;
  EXPECT(VSPLAT_OK, vsplat_render(device, scene, &camera, NULL, &picture));
}

static void draws_into_buffers(program p, vsplat_device device, vsplat_scene scene) {
  static pictures want, got;
  const vsplat_camera camera = make_camera();
  vsplat_opencl_picture picture = VSPLAT_OPENCL_PICTURE_INIT;
  cl_event done = NULL;
  cl_int state = -1;
  draw_to_host(device, scene, &want);
  HOLD(want.colour[3 * (pixels / 2 + width / 2)] != want.colour[0]);
  memset(&got, 0x5a, sizeof got);
  picture.colour = buffer_of(p, values, NULL);
  picture.depth = buffer_of(p, pixels, NULL);
  EXPECT(VSPLAT_OK, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 0, NULL, &done));
  HOLD(clWaitForEvents(1, &done) == CL_SUCCESS);
  HOLD(clGetEventInfo(done, CL_EVENT_COMMAND_EXECUTION_STATUS, sizeof state, &state, NULL) == CL_SUCCESS);
  HOLD(state == CL_COMPLETE);
  clReleaseEvent(done);
  read_back(p, picture.colour, values, got.colour);
  read_back(p, picture.depth, pixels, got.depth);
  HOLD(memcmp(got.colour, want.colour, sizeof got.colour) == 0);
  HOLD(memcmp(got.depth, want.depth, sizeof got.depth) == 0);
  clReleaseMemObject(picture.colour);
  clReleaseMemObject(picture.depth);
}

/* The profile contains no copy of the picture: only the number of visible Gaussians is read for each frame. */
static void copies_no_picture(program p, vsplat_device device, vsplat_scene scene) {
  const vsplat_camera camera = make_camera();
  vsplat_opencl_picture picture = VSPLAT_OPENCL_PICTURE_INIT;
  char* text = NULL;
  const char* at;
  double bytes = 0;
  int i;
  picture.colour = buffer_of(p, values, NULL);
  EXPECT(VSPLAT_OK,
         vsplat_opencl_render(device, scene, &camera, NULL, &picture, 0, NULL, NULL)); /* it is on the device now */
  EXPECT(VSPLAT_OK, vsplat_device_profile(device, 1));
  for (i = 0; i < 10; ++i)
    EXPECT(VSPLAT_OK, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 0, NULL, NULL));
  EXPECT(VSPLAT_OK, vsplat_device_profile_text(device, VSPLAT_PROFILE_JSON, &text));
  EXPECT(VSPLAT_OK, vsplat_device_profile(device, 0));
  HOLD(strstr(text, "\"rasterize"));
  for (at = text; (at = strstr(at, "\"stage\"")) != NULL; ++at) {
    const char *row = at, *size;
    while (row > text && *row != '{') --row;
    if (strncmp(at + 7 + strcspn(at + 7, "\"") + 1, "transfer", 8) != 0) continue;
    size = strstr(row, "\"bytes\"");
    if (size) bytes += atof(size + 7 + strspn(size + 7, ": "));
  }
  HOLD(bytes < 10 * 200); /* a picture has 24,960 */
  vsplat_text_free(text);
  clReleaseMemObject(picture.colour);
}

typedef struct completer {
  cl_event event;
  volatile int completed;
} completer;

static void* completes(void* user) {
  completer* c = user;
  usleep(100000);
  c->completed = 1;
  clSetUserEventStatus(c->event, CL_COMPLETE);
  return NULL;
}

static void waits_for_events(program p, vsplat_device device, vsplat_scene scene) {
  const vsplat_camera camera = make_camera();
  vsplat_opencl_picture picture = VSPLAT_OPENCL_PICTURE_INIT;
  completer c = {NULL, 0};
  cl_int error = CL_SUCCESS;
  cl_event done = NULL;
  pthread_t id;
  c.event = clCreateUserEvent(p.context, &error);
  HOLD(error == CL_SUCCESS);
  picture.colour = buffer_of(p, values, NULL);
  HOLD(pthread_create(&id, NULL, completes, &c) == 0);
  EXPECT(VSPLAT_OK, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 1, &c.event, &done));
  HOLD(clWaitForEvents(1, &done) == CL_SUCCESS && c.completed);
  HOLD(pthread_join(id, NULL) == 0);
  clReleaseEvent(done);
  clReleaseEvent(c.event);
  clReleaseMemObject(picture.colour);
}

static void differentiates_in_buffers(program p, vsplat_device device, vsplat_scene scene) {
  static float by_colour[values], want_means[3 * count], got_means[3 * count], want_sh[3 * count], got_sh[3 * count];
  const vsplat_camera camera = make_camera();
  vsplat_picture gradient = VSPLAT_PICTURE_INIT;
  vsplat_gaussians want = VSPLAT_GAUSSIANS_INIT;
  vsplat_opencl_picture by = VSPLAT_OPENCL_PICTURE_INIT;
  vsplat_opencl_gaussians got = VSPLAT_OPENCL_GAUSSIANS_INIT;
  int i;
  for (i = 0; i < values; ++i) by_colour[i] = (float)(i * 37 % 101) / 101 - 0.4f;
  gradient.capacity = pixels;
  gradient.colour = by_colour;
  want.capacity = count;
  want.means = want_means, want.sh = want_sh;
  EXPECT(VSPLAT_OK, vsplat_render_backward(device, scene, &camera, NULL, &gradient, &want, NULL));
  by.colour = buffer_of(p, values, by_colour);
  got.means = buffer_of(p, 3 * count, by_colour); /* earlier values are replaced */
  got.sh = buffer_of(p, 3 * count, NULL);
  EXPECT(VSPLAT_OK, vsplat_opencl_render_backward(device, scene, &camera, NULL, &by, &got, 0, NULL, NULL));
  read_back(p, got.means, 3 * count, got_means);
  read_back(p, got.sh, 3 * count, got_sh);
  HOLD(want_means[0] != 0 && memcmp(got_means, want_means, sizeof want_means) == 0);
  HOLD(want_sh[0] != 0 && memcmp(got_sh, want_sh, sizeof want_sh) == 0);
  clReleaseMemObject(by.colour);
  clReleaseMemObject(got.means);
  clReleaseMemObject(got.sh);
}

static void takes_scenes_from_buffers(program p, vsplat_device device, vsplat_scene scene) {
  static pictures want, got;
  vsplat_scene_info info = scene_info();
  vsplat_opencl_gaussians from = VSPLAT_OPENCL_GAUSSIANS_INIT;
  vsplat_scene made = NULL, none = NULL;
  from.means = buffer_of(p, 3 * count, means), from.scales = buffer_of(p, 3 * count, scales);
  from.rotations = buffer_of(p, 4 * count, rotations), from.opacities = buffer_of(p, count, opacities);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_scene_create(device, &info, &from, 0, NULL, &none)); /* no sh */
  from.sh = buffer_of(p, 3 * count, sh);
  info.count = count + 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_scene_create(device, &info, &from, 0, NULL, &none));
  HOLD(strstr(vsplat_last_error(), "buffers.means") != NULL && !none);
  info.count = count;
  EXPECT(VSPLAT_OK, vsplat_opencl_scene_create(device, &info, &from, 0, NULL, &made));
  draw_to_host(device, scene, &want);
  draw_to_host(device, made, &got);
  HOLD(memcmp(&got, &want, sizeof got) == 0);
  vsplat_scene_release(made);
  clReleaseMemObject(from.means);
  clReleaseMemObject(from.scales);
  clReleaseMemObject(from.rotations);
  clReleaseMemObject(from.opacities);
  clReleaseMemObject(from.sh);
}

/* A kernel of the program doubles the distance from grey of every Gaussian's colour, in the library's memory. */
static void a_kernel_changes_the_scene(program p, vsplat_device device) {
  static pictures before, changed, again;
  static float stored[3 * count];
  const size_t n = 3 * count;
  vsplat_scene scene = make_scene(3);
  vsplat_opencl_gaussians there = VSPLAT_OPENCL_GAUSSIANS_INIT;
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
  cl_int error = CL_SUCCESS;
  const char* source = doubling;
  cl_program built = clCreateProgramWithSource(p.context, 1, &source, NULL, &error);
  cl_kernel twice;
  int i, good = 1;
  HOLD(error == CL_SUCCESS && clBuildProgram(built, 1, &p.device, "", NULL, NULL) == CL_SUCCESS);
  twice = clCreateKernel(built, "twice", &error);
  HOLD(error == CL_SUCCESS);
  draw_to_host(device, scene, &before);
  EXPECT(VSPLAT_OK, vsplat_opencl_scene_buffers(device, scene, &there));
  HOLD(there.means && there.scales && there.rotations && there.opacities && there.sh);
  HOLD(clSetKernelArg(twice, 0, sizeof there.sh, &there.sh) == CL_SUCCESS);
  HOLD(clEnqueueNDRangeKernel(p.queue, twice, 1, NULL, &n, NULL, 0, NULL, NULL) == CL_SUCCESS);
  draw_to_host(device, scene, &changed);
  HOLD(memcmp(changed.colour, before.colour, sizeof before.colour) != 0);
  HOLD(memcmp(changed.alpha, before.alpha, sizeof before.alpha) == 0);
  arrays.capacity = count;
  arrays.sh = stored;
  EXPECT(VSPLAT_OK, vsplat_scene_get_gaussians(scene, &arrays));
  HOLD(memcmp(stored, sh, sizeof stored) == 0); /* the scene itself is unchanged */
  EXPECT(VSPLAT_OK, vsplat_opencl_scene_store(device, scene));
  EXPECT(VSPLAT_OK, vsplat_scene_get_gaussians(scene, &arrays));
  for (i = 0; i < 3 * count; ++i) good = good && stored[i] == 2 * sh[i];
  HOLD(good);
  EXPECT(VSPLAT_OK, vsplat_device_trim(device)); /* uploaded again from the host */
  draw_to_host(device, scene, &again);
  HOLD(memcmp(&again, &changed, sizeof again) == 0);
  clReleaseKernel(twice);
  clReleaseProgram(built);
  vsplat_scene_release(scene);
}

static void refuses(program p, program other, vsplat_device device, vsplat_scene scene) {
  const vsplat_camera camera = make_camera();
  vsplat_opencl_picture picture = VSPLAT_OPENCL_PICTURE_INIT;
  vsplat_opencl_handles h = VSPLAT_OPENCL_HANDLES_INIT;
  vsplat_device none = NULL;
  const cl_event no_event = NULL;
  cl_int error = CL_SUCCESS;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_open(&h, NULL, &none)); /* no context */
  h.context = p.context, h.device = p.device, h.queue = other.queue;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_open(&h, NULL, &none));
  HOLD(strstr(vsplat_last_error(), "cl_command_queue") != NULL);
  h.context = other.context;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_open(&h, NULL, &none)); /* an out-of-order queue */
  HOLD(strstr(vsplat_last_error(), "out of order") != NULL && !none);
  picture.colour = buffer_of(p, values - 1, NULL);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 0, NULL, NULL));
  HOLD(strstr(vsplat_last_error(), "picture.colour is a buffer of 24956 bytes: at least 24960 expected") != NULL);
  clReleaseMemObject(picture.colour);
  picture.colour = buffer_of(other, values, NULL);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 0, NULL, NULL));
  HOLD(strstr(vsplat_last_error(), "another cl_context") != NULL);
  clReleaseMemObject(picture.colour);
  picture.colour = clCreateBuffer(p.context, CL_MEM_READ_ONLY, values * sizeof(float), NULL, &error);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 0, NULL, NULL));
  HOLD(strstr(vsplat_last_error(), "CL_MEM_READ_ONLY") != NULL);
  clReleaseMemObject(picture.colour);
  picture.colour = NULL;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 1, NULL, NULL));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 1, &no_event, NULL));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 0, NULL, NULL));
  HOLD(strstr(vsplat_last_error(), "nothing to draw into") != NULL);
}

/* One buffer, or two overlapping parts of one, for two outputs, or for an input and an output. */
static void refuses_shared(program p, vsplat_device device, vsplat_scene scene) {
  const vsplat_camera camera = make_camera();
  vsplat_opencl_picture picture = VSPLAT_OPENCL_PICTURE_INIT;
  vsplat_opencl_gaussians out = VSPLAT_OPENCL_GAUSSIANS_INIT;
  cl_mem whole = buffer_of(p, 4096 + values, NULL), alone = buffer_of(p, values, NULL);
  cl_buffer_region region = {4096, values * sizeof(float)};
  cl_int error = CL_SUCCESS;
  cl_mem part = clCreateSubBuffer(whole, CL_MEM_READ_WRITE, CL_BUFFER_CREATE_TYPE_REGION, &region, &error);
  HOLD(error == CL_SUCCESS);
  picture.alpha = picture.depth = alone;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 0, NULL, NULL));
  HOLD(strstr(vsplat_last_error(), "picture.alpha and picture.depth share memory") != NULL);
  picture.alpha = whole, picture.depth = part; /* 8320 bytes, and from 4096 on */
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 0, NULL, NULL));
  picture.alpha = alone;
  EXPECT(VSPLAT_OK, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 0, NULL, NULL));
  EXPECT(VSPLAT_ERROR_USAGE,
         vsplat_opencl_render_backward(device, scene, &camera, NULL, &picture, &out, 0, NULL, NULL));
  out.means = out.scales = whole;
  EXPECT(VSPLAT_ERROR_USAGE,
         vsplat_opencl_render_backward(device, scene, &camera, NULL, &picture, &out, 0, NULL, NULL));
  out.means = NULL, out.scales = alone;
  EXPECT(VSPLAT_ERROR_USAGE,
         vsplat_opencl_render_backward(device, scene, &camera, NULL, &picture, &out, 0, NULL, NULL));
  HOLD(strstr(vsplat_last_error(), "gradient.alpha and out.scales share memory") != NULL);
  out.scales = whole; /* 720 bytes before the part */
  EXPECT(VSPLAT_OK, vsplat_opencl_render_backward(device, scene, &camera, NULL, &picture, &out, 0, NULL, NULL));
  clReleaseMemObject(part);
  clReleaseMemObject(whole);
  clReleaseMemObject(alone);
}

static void* fails(void* user) {
  usleep(100000);
  clSetUserEventStatus(*(cl_event*)user, CL_OUT_OF_RESOURCES);
  return NULL;
}

/* Events that have failed, that fail while being waited for, or that belong to another context. The device stays
   usable. */
static void refuses_failed_events(program p, program other, vsplat_device device, vsplat_scene scene) {
  static pictures before, after;
  const vsplat_camera camera = make_camera();
  vsplat_opencl_picture picture = VSPLAT_OPENCL_PICTURE_INIT;
  cl_int error = CL_SUCCESS;
  cl_event failed = clCreateUserEvent(p.context, &error), failing, foreign, done = NULL;
  pthread_t id;
  picture.alpha = buffer_of(p, pixels, NULL);
  draw_to_host(device, scene, &before);
  HOLD(clSetUserEventStatus(failed, CL_OUT_OF_RESOURCES) == CL_SUCCESS);
  EXPECT(VSPLAT_ERROR_DEVICE, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 1, &failed, &done));
  HOLD(strstr(vsplat_last_error(), "events[0] has failed with CL_OUT_OF_RESOURCES") != NULL);
  failing = clCreateUserEvent(p.context, &error);
  HOLD(pthread_create(&id, NULL, fails, &failing) == 0);
  EXPECT(VSPLAT_ERROR_DEVICE, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 1, &failing, &done));
  HOLD(pthread_join(id, NULL) == 0);
  foreign = clCreateUserEvent(other.context, &error);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 1, &foreign, &done));
  HOLD(strstr(vsplat_last_error(), "another cl_context") != NULL);
  HOLD(done == NULL);
  draw_to_host(device, scene, &after);
  HOLD(memcmp(&before, &after, sizeof before) == 0);
  clSetUserEventStatus(foreign, CL_COMPLETE);
  clReleaseEvent(failed);
  clReleaseEvent(failing);
  clReleaseEvent(foreign);
  clReleaseMemObject(picture.alpha);
}

int main(void) {
  program p = make_program(CL_QUEUE_PROFILING_ENABLE), other = make_program(CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE);
  vsplat_device device = open_on(p, 1), own_queue = open_on(p, 0);
  vsplat_scene scene = make_scene(3);
  draws_into_buffers(p, device, scene);
  draws_into_buffers(p, own_queue, scene);
  refuses_shared(p, device, scene);
  refuses_failed_events(p, other, device, scene);
  copies_no_picture(p, device, scene);
  waits_for_events(p, device, scene);
  differentiates_in_buffers(p, device, scene);
  takes_scenes_from_buffers(p, device, scene);
  a_kernel_changes_the_scene(p, device);
  refuses(p, other, device, scene);
  vsplat_scene_release(scene);
  vsplat_device_release(own_queue);
  vsplat_device_release(device);
  release_program(other);
  release_program(p);
  return failures == 0 ? 0 : 1;
}
