/* vsplat_opencl_picture.rgba: bytes drawn into a program's buffer or image are compared with vsplat_render's; invalid
   requests are refused. Prints every check that fails; exits 1 if any did. */
#include <stdlib.h>
#include <string.h>

#include "opencl_program.h"

enum { bytes = 4 * pixels };

static vsplat_render_options over_red(void) {
  vsplat_render_options out = VSPLAT_RENDER_OPTIONS_INIT;
  out.background[0] = 0.9f, out.background[1] = 0.2f, out.background[2] = 0.1f;
  return out;
}

/* The bytes of vsplat_picture.data. */
static void draw_bytes_to_host(vsplat_device device, vsplat_scene scene, int premultiplied, unsigned char* out) {
  const vsplat_camera camera = make_camera();
  const vsplat_render_options options = over_red();
  vsplat_picture picture = VSPLAT_PICTURE_INIT;
  picture.data = out, picture.data_bytes = bytes;
  picture.type = VSPLAT_PIXELS_U8, picture.channels = 4, picture.premultiplied = premultiplied;
  EXPECT(VSPLAT_OK, vsplat_render(device, scene, &camera, &options, &picture));
}

static cl_mem image_of(program p, cl_channel_order order, cl_channel_type type, size_t w, size_t h) {
  const cl_image_format format = {order, type};
  cl_int error = CL_SUCCESS;
  cl_image_desc desc;
  cl_mem out;
  memset(&desc, 0, sizeof desc);
  desc.image_type = CL_MEM_OBJECT_IMAGE2D, desc.image_width = w, desc.image_height = h;
  out = clCreateImage(p.context, CL_MEM_READ_WRITE, &format, &desc, NULL, &error);
  HOLD(error == CL_SUCCESS);
  return out;
}

static int has_images(program p) {
  cl_bool out = CL_FALSE;
  HOLD(clGetDeviceInfo(p.device, CL_DEVICE_IMAGE_SUPPORT, sizeof out, &out, NULL) == CL_SUCCESS);
  if (!out) printf("The device has no images: buffers alone are tried.\n");
  return out == CL_TRUE;
}

static void read_bytes(program p, cl_mem from, int is_image, unsigned char* to) {
  const size_t origin[3] = {0, 0, 0}, region[3] = {width, height, 1};
  memset(to, 0x5a, bytes);
  HOLD((is_image ? clEnqueueReadImage(p.queue, from, CL_TRUE, origin, region, 0, 0, to, 0, NULL, NULL)
                 : clEnqueueReadBuffer(p.queue, from, CL_TRUE, 0, bytes, to, 0, NULL, NULL)) == CL_SUCCESS);
}

/* `to` is a buffer or an image. Draws bytes alone, and together with floats, which must be the same as without them. */
static void draws_bytes(program p, vsplat_device device, vsplat_scene scene, cl_mem to, int is_image) {
  static unsigned char want[2][bytes], got[bytes];
  static float plain[values], beside[values];
  const vsplat_camera camera = make_camera();
  const vsplat_render_options options = over_red();
  vsplat_opencl_picture picture = VSPLAT_OPENCL_PICTURE_INIT;
  int premultiplied, i, opaque = 0;
  cl_event done = NULL;
  for (premultiplied = 0; premultiplied < 2; ++premultiplied) {
    draw_bytes_to_host(device, scene, premultiplied, want[premultiplied]);
    picture.rgba = to, picture.premultiplied = premultiplied;
    EXPECT(VSPLAT_OK, vsplat_opencl_render(device, scene, &camera, &options, &picture, 0, NULL, &done));
    HOLD(clWaitForEvents(1, &done) == CL_SUCCESS);
    clReleaseEvent(done);
    read_bytes(p, to, is_image, got);
    HOLD(memcmp(got, want[premultiplied], bytes) == 0);
  }
  for (i = 3; i < bytes; i += 4) opaque += got[i] > 128;
  HOLD(opaque > 20 && got[3] == 0 && memcmp(want[0], want[1], bytes) != 0);

  picture.rgba = NULL;
  picture.colour = buffer_of(p, values, NULL);
  EXPECT(VSPLAT_OK, vsplat_opencl_render(device, scene, &camera, &options, &picture, 0, NULL, NULL));
  read_back(p, picture.colour, values, plain);
  picture.rgba = to;
  EXPECT(VSPLAT_OK, vsplat_opencl_render(device, scene, &camera, &options, &picture, 0, NULL, NULL));
  read_back(p, picture.colour, values, beside);
  read_bytes(p, to, is_image, got);
  HOLD(memcmp(got, want[1], bytes) == 0 && memcmp(plain, beside, sizeof plain) == 0);
  clReleaseMemObject(picture.colour);
}

/* Draws into a part of a buffer; the rest stays unchanged. */
static void draws_bytes_into_a_part(program p, vsplat_device device, vsplat_scene scene) {
  static unsigned char want[bytes], got[bytes + 8192];
  const vsplat_camera camera = make_camera();
  const vsplat_render_options options = over_red();
  vsplat_opencl_picture picture = VSPLAT_OPENCL_PICTURE_INIT;
  cl_buffer_region region = {4096, bytes};
  cl_int error = CL_SUCCESS;
  cl_mem whole;
  int i, kept = 1;
  memset(got, 0x5a, sizeof got);
  whole = clCreateBuffer(p.context, CL_MEM_READ_WRITE | CL_MEM_COPY_HOST_PTR, sizeof got, got, &error);
  HOLD(error == CL_SUCCESS);
  picture.rgba = clCreateSubBuffer(whole, CL_MEM_READ_WRITE, CL_BUFFER_CREATE_TYPE_REGION, &region, &error);
  HOLD(error == CL_SUCCESS);
  draw_bytes_to_host(device, scene, 0, want);
  EXPECT(VSPLAT_OK, vsplat_opencl_render(device, scene, &camera, &options, &picture, 0, NULL, NULL));
  HOLD(clEnqueueReadBuffer(p.queue, whole, CL_TRUE, 0, sizeof got, got, 0, NULL, NULL) == CL_SUCCESS);
  for (i = 0; i < 4096; ++i) kept = kept && got[i] == 0x5a && got[4096 + bytes + i] == 0x5a;
  HOLD(kept && memcmp(got + 4096, want, bytes) == 0);
  clReleaseMemObject(picture.rgba);
  clReleaseMemObject(whole);
}

/* The call is refused with these words, and writes nothing. */
static void refuses(vsplat_device device, vsplat_scene scene, const vsplat_opencl_picture* picture, const char* words) {
  const vsplat_camera camera = make_camera();
  cl_event done = NULL;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_render(device, scene, &camera, NULL, picture, 0, NULL, &done));
  if (!strstr(vsplat_last_error(), words)) printf("\"%s\", not \"%s\"\n", vsplat_last_error(), words);
  HOLD(strstr(vsplat_last_error(), words) != NULL && done == NULL);
}

static void refuses_buffers(program p, program other, vsplat_device device, vsplat_scene scene) {
  const vsplat_camera camera = make_camera();
  vsplat_opencl_picture picture = VSPLAT_OPENCL_PICTURE_INIT;
  cl_buffer_region region = {4096, bytes};
  cl_int error = CL_SUCCESS;
  cl_mem whole = buffer_of(p, 4096 + pixels, NULL), part;
  refuses(device, scene, &picture, "nothing to draw into");
  picture.rgba = clCreateBuffer(p.context, CL_MEM_READ_WRITE, bytes - 1, NULL, &error);
  refuses(device, scene, &picture, "picture.rgba is a buffer of 8319 bytes: at least 8320 expected");
  clReleaseMemObject(picture.rgba);
  picture.rgba = buffer_of(other, pixels, NULL);
  refuses(device, scene, &picture, "picture.rgba is a buffer of another cl_context");
  clReleaseMemObject(picture.rgba);
  picture.rgba = clCreateBuffer(p.context, CL_MEM_READ_ONLY, bytes, NULL, &error);
  refuses(device, scene, &picture, "CL_MEM_READ_ONLY");
  clReleaseMemObject(picture.rgba);

  picture.rgba = picture.alpha = whole;
  refuses(device, scene, &picture, "picture.alpha and picture.rgba share memory");
  picture.alpha = NULL, picture.colour = whole;
  refuses(device, scene, &picture, "picture.colour is a buffer of"); /* too small, which is reported first */
  picture.colour = NULL, picture.depth = whole;
  part = clCreateSubBuffer(whole, CL_MEM_READ_WRITE, CL_BUFFER_CREATE_TYPE_REGION, &region, &error);
  HOLD(error == CL_SUCCESS);
  picture.rgba = part; /* bytes from 4096 on; the depths take 4224 */
  refuses(device, scene, &picture, "picture.depth and picture.rgba share memory");

  picture.depth = NULL;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_opencl_render(device, scene, &camera, NULL, &picture, 1, NULL, NULL));
  clReleaseMemObject(part);
  clReleaseMemObject(whole);
}

static void refuses_images(program p, program other, vsplat_device device, vsplat_scene scene) {
  static const struct {
    cl_channel_order order;
    cl_channel_type type;
    int w, h, is_other;
    const char* words;
  } cases[] = {{CL_RGBA, CL_UNORM_INT8, height, width, 0, "is an image of 40 x 52 pixels: 52 x 40 expected"},
               {CL_RGBA, CL_UNORM_INT8, width, height - 1, 0, "52 x 39 pixels"},
               {CL_RGBA, CL_UNORM_INT8, width + 1, height, 0, "53 x 40 pixels"},
               {CL_RGBA, CL_FLOAT, width, height, 0, "a format other than CL_RGBA with"},
               {CL_BGRA, CL_UNORM_INT8, width, height, 0, "a format other than CL_RGBA with"},
               {CL_RGBA, CL_UNORM_INT8, width, height, 1, "an image of another cl_context"}};
  vsplat_opencl_picture picture = VSPLAT_OPENCL_PICTURE_INIT;
  size_t i;
  for (i = 0; i < sizeof cases / sizeof *cases; ++i) {
    picture.rgba =
        image_of(cases[i].is_other ? other : p, cases[i].order, cases[i].type, (size_t)cases[i].w, (size_t)cases[i].h);
    refuses(device, scene, &picture, cases[i].words);
    clReleaseMemObject(picture.rgba);
  }
  /* An image is refused where floats are expected. */
  picture.rgba = NULL;
  picture.colour = image_of(p, CL_RGBA, CL_FLOAT, width, height);
  refuses(device, scene, &picture, "picture.colour is no buffer");
  clReleaseMemObject(picture.colour);
}

int main(void) {
  program p = make_program(0), other = make_program(0);
  vsplat_device device = open_on(p, 1), own_queue = open_on(p, 0);
  vsplat_scene scene = make_scene(3);
  cl_mem buffer = buffer_of(p, pixels, NULL);
  draws_bytes(p, device, scene, buffer, 0);
  draws_bytes_into_a_part(p, device, scene);
  refuses_buffers(p, other, device, scene);
  if (has_images(p)) {
    const cl_channel_type types[] = {CL_UNORM_INT8, CL_UNSIGNED_INT8};
    int i;
    for (i = 0; i < 2; ++i) {
      cl_mem image = image_of(p, CL_RGBA, types[i], width, height);
      draws_bytes(p, device, scene, image, 1);
      clReleaseMemObject(image);
    }
    refuses_images(p, other, device, scene);
  }
  clReleaseMemObject(buffer);
  vsplat_scene_release(scene);
  vsplat_device_release(own_queue);
  vsplat_device_release(device);
  release_program(other);
  release_program(p);
  return failures == 0 ? 0 : 1;
}
