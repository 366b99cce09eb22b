/* Data as callers have them: pictures of 8 and 16 bits, in rows with gaps, with premultiplied alpha, seen through
   lenses; models and scenes as a file's bytes. Each equals the result of the plain form. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "micro_input.h"

enum { EDGE = 16, PIXELS = EDGE * EDGE };

static char folder[] = "/tmp/vsplat-memory-XXXXXX";

static const char* in_folder(const char* name) {
  static char path[2][256];
  static int which = 0;
  which = !which;
  snprintf(path[which], sizeof path[which], "%s/%s", folder, name);
  return path[which];
}

static unsigned char* bytes_of(const char* path, size_t* size) {
  FILE* file = fopen(path, "rb");
  unsigned char* out = NULL;
  *size = 0;
  if (!file) return NULL;
  fseek(file, 0, SEEK_END);
  *size = (size_t)ftell(file);
  rewind(file);
  out = malloc(*size + 1);
  if (fread(out, 1, *size, file) != *size) *size = 0;
  fclose(file);
  return out;
}

/* Two views that differ only in their picture; `camera_change` may give them a lens. */
static vsplat_views views_with(const vsplat_view* picture, const vsplat_camera* lens) {
  vsplat_view all[2] = {VSPLAT_VIEW_INIT, VSPLAT_VIEW_INIT};
  vsplat_views out = NULL;
  int i;
  for (i = 0; i < 2; ++i) {
    vsplat_camera* camera = &all[i].camera;
    all[i] = *picture;
    camera->width = camera->height = EDGE;
    camera->fx = camera->fy = 1.25 * EDGE;
    camera->cx = camera->cy = EDGE / 2.0;
    camera->w2c[0] = camera->w2c[10] = i ? -1 : 1;
    camera->w2c[11] = 2;
    if (lens) {
      camera->lens = lens->lens;
      memcpy(camera->lens_values, lens->lens_values, sizeof lens->lens_values);
    }
  }
  EXPECT(VSPLAT_OK, vsplat_views_create(all, 2, &out));
  return out;
}

/* The network's input for these views, as pictures in a folder. */
static unsigned char* seen(vsplat_model model, const vsplat_view* picture, const vsplat_camera* lens, size_t* size) {
  vsplat_views views = views_with(picture, lens);
  vsplat_input input = NULL;
  static int count = 0;
  char name[32], file[64];
  snprintf(name, sizeof name, "seen%d", ++count);
  snprintf(file, sizeof file, "%s/0.png", name);
  EXPECT(VSPLAT_OK, vsplat_input_prepare(model, views, NULL, &input));
  EXPECT(VSPLAT_OK, vsplat_input_save(input, in_folder(name)));
  vsplat_input_release(input);
  vsplat_views_release(views);
  return bytes_of(in_folder(file), size);
}

static int same(vsplat_model model, const vsplat_view* a, const vsplat_camera* lens_a, const vsplat_view* b,
                const vsplat_camera* lens_b) {
  size_t na = 0, nb = 0;
  unsigned char *x = seen(model, a, lens_a, &na), *y = seen(model, b, lens_b, &nb);
  const int out = na > 0 && na == nb && memcmp(x, y, na) == 0;
  free(x);
  free(y);
  return out;
}

static uint16_t half_of_eighths(int eighths) { /* 0 to 8 */
  static const uint16_t halves[] = {0x0000, 0x3000, 0x3400, 0x3600, 0x3800, 0x3900, 0x3a00, 0x3b00, 0x3c00};
  return halves[eighths];
}

static void test_pixels(vsplat_model model) {
  static float f32[PIXELS * 4];
  static unsigned char u8[PIXELS * 4], gaps[EDGE * (EDGE * 3 + 5)];
  static uint16_t f16[PIXELS * 4];
  vsplat_view plain = VSPLAT_VIEW_INIT, other = VSPLAT_VIEW_INIT, mixed = VSPLAT_VIEW_INIT;
  int i;
  for (i = 0; i < PIXELS * 3; ++i) {
    u8[i] = (unsigned char)(i * 7919 % 256);
    f32[i] = (float)u8[i] / 255.0f;
  }
  plain.pixels = f32;
  other.data = u8, other.type = VSPLAT_PIXELS_U8;
  HOLD(same(model, &plain, NULL, &other, NULL));
  memset(gaps, 77, sizeof gaps);
  for (i = 0; i < EDGE; ++i) memcpy(gaps + i * (EDGE * 3 + 5), u8 + i * EDGE * 3, EDGE * 3);
  other.data = gaps, other.row_bytes = EDGE * 3 + 5;
  HOLD(same(model, &plain, NULL, &other, NULL));
  other.row_bytes = EDGE * 3 + 4;
  HOLD(!same(model, &plain, NULL, &other, NULL));
  for (i = 0; i < PIXELS * 3; ++i) {
    f32[i] = (float)(i % 9) / 8.0f;
    f16[i] = half_of_eighths(i % 9);
  }
  other = plain, other.pixels = NULL;
  other.data = f16, other.type = VSPLAT_PIXELS_F16;
  HOLD(same(model, &plain, NULL, &other, NULL));
  /* Alpha: colours and alphas that are exact in half precision, so that multiplying and dividing lose nothing. */
  for (i = 0; i < PIXELS; ++i) {
    const float alpha = (float)(i % 3) / 2.0f;
    int c;
    for (c = 0; c < 3; ++c) f32[4 * i + c] = (float)((i + c) % 9) / 8.0f;
    f32[4 * i + 3] = alpha;
  }
  plain.channels = mixed.channels = 4;
  static float multiplied[PIXELS * 4];
  for (i = 0; i < PIXELS * 4; ++i) multiplied[i] = i % 4 == 3 ? f32[i] : f32[i] * f32[i / 4 * 4 + 3];
  mixed.pixels = multiplied;
  HOLD(!same(model, &plain, NULL, &mixed, NULL));
  mixed.premultiplied = 1;
  HOLD(same(model, &plain, NULL, &mixed, NULL));
}

static void test_lenses(vsplat_model model) {
  static float pixels[PIXELS * 3];
  vsplat_view plain = VSPLAT_VIEW_INIT;
  vsplat_camera none = VSPLAT_CAMERA_INIT, lens = VSPLAT_CAMERA_INIT, zero = VSPLAT_CAMERA_INIT;
  vsplat_views views = NULL;
  vsplat_input input = NULL;
  size_t nfile = 0, nmemory = 0;
  unsigned char *file, *memory;
  FILE* list;
  int i;
  for (i = 0; i < PIXELS * 3; ++i) pixels[i] = (float)(i * 31 % 256) / 255.0f;
  plain.pixels = pixels;
  zero.lens = VSPLAT_LENS_OPENCV;
  lens.lens = VSPLAT_LENS_OPENCV;
  lens.lens_values[0] = -0.2;
  lens.lens_values[2] = 0.01;
  HOLD(same(model, &plain, &none, &plain, &zero));
  HOLD(!same(model, &plain, &none, &plain, &lens));
  lens.lens = VSPLAT_LENS_FISHEYE;
  HOLD(!same(model, &plain, &none, &plain, &lens));
  /* The same picture and lens, from files. */
  lens.lens = VSPLAT_LENS_OPENCV;
  memory = seen(model, &plain, &lens, &nmemory);
  {
    vsplat_picture picture = VSPLAT_PICTURE_INIT;
    picture.capacity = PIXELS;
    picture.colour = pixels;
    EXPECT(VSPLAT_OK, vsplat_picture_save(&picture, EDGE, EDGE, VSPLAT_PICTURE_PNG, in_folder("a.png")));
    EXPECT(VSPLAT_OK, vsplat_picture_save(&picture, EDGE, EDGE, VSPLAT_PICTURE_PNG, in_folder("b.png")));
  }
  list = fopen(in_folder("transforms.json"), "w");
  fprintf(
      list,
      "{\"camera_model\": \"OPENCV\", \"w\": 16, \"h\": 16, \"fl_x\": 20, \"fl_y\": 20, \"cx\": 8, \"cy\": 8, \"k1\": "
      "-0.2, \"p1\": 0.01, \"frames\": [{\"file_path\": \"a.png\", \"transform_matrix\": [[1, 0, 0, 0], [0, -1, 0, "
      "0], [0, 0, -1, -2], [0, 0, 0, 1]]}, {\"file_path\": \"b.png\", \"transform_matrix\": [[-1, 0, 0, 0], [0, "
      "-1, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]]}]}");
  fclose(list);
  EXPECT(VSPLAT_OK, vsplat_views_load(in_folder("transforms.json"), NULL, &views));
  EXPECT(VSPLAT_OK, vsplat_input_prepare(model, views, NULL, &input));
  EXPECT(VSPLAT_OK, vsplat_input_save(input, in_folder("fromfile")));
  file = bytes_of(in_folder("fromfile/a.png"), &nfile);
  HOLD(nfile > 0 && nfile == nmemory && memcmp(file, memory, nfile) == 0);
  free(file);
  free(memory);
  vsplat_input_release(input);
  vsplat_views_release(views);
}

/* Output formats: each equals the conversion of the plain one. */
static void test_pictures_out(vsplat_device device, vsplat_scene scene) {
  enum { GAP = 5 };
  static float colour[PIXELS * 3], alpha[PIXELS], over_black[PIXELS * 3], f32[PIXELS * 4];
  static unsigned char rows[EDGE][EDGE * 3 + GAP], rgba[PIXELS * 4];
  static uint16_t f16[PIXELS * 4];
  vsplat_camera camera = VSPLAT_CAMERA_INIT;
  vsplat_render_options options = VSPLAT_RENDER_OPTIONS_INIT;
  vsplat_picture plain = VSPLAT_PICTURE_INIT, other = VSPLAT_PICTURE_INIT;
  int i, c, bad = 0, half = 0;
  camera.width = camera.height = EDGE;
  camera.fx = camera.fy = 1.25 * EDGE;
  camera.cx = camera.cy = EDGE / 2.0;
  camera.w2c[11] = 2;
  options.background[0] = 0.25f, options.background[1] = 0.5f, options.background[2] = 0.75f;
  plain.capacity = other.capacity = PIXELS;
  plain.colour = colour, plain.alpha = alpha;
  EXPECT(VSPLAT_OK, vsplat_render(device, scene, &camera, &options, &plain));
  memset(rows, 171, sizeof rows);
  other.data = rows, other.type = VSPLAT_PIXELS_U8, other.row_bytes = EDGE * 3 + GAP;
  EXPECT(VSPLAT_OK, vsplat_render(device, scene, &camera, &options, &other));
  for (i = 0; i < PIXELS; ++i)
    for (c = 0; c < 3; ++c) {
      const float v = colour[3 * i + c] > 1 ? 1 : colour[3 * i + c];
      bad += rows[i / EDGE][3 * (i % EDGE) + c] != (unsigned char)lroundf(255 * v);
    }
  for (i = 0; i < EDGE; ++i)
    for (c = 0; c < GAP; ++c) bad += rows[i][EDGE * 3 + c] != 171;
  HOLD(bad == 0);
  /* Without the background: drawing over black gives premultiplied colours. */
  options.background[0] = options.background[1] = options.background[2] = 0;
  plain.colour = over_black;
  EXPECT(VSPLAT_OK, vsplat_render(device, scene, &camera, &options, &plain));
  options.background[0] = 0.25f, options.background[1] = 0.5f, options.background[2] = 0.75f;
  other.data = f32, other.type = VSPLAT_PIXELS_F32, other.row_bytes = 0, other.channels = 4, other.premultiplied = 1;
  EXPECT(VSPLAT_OK, vsplat_render(device, scene, &camera, &options, &other));
  for (i = 0; i < PIXELS; ++i) {
    half += alpha[i] > 0.02f && alpha[i] < 0.98f;
    bad += f32[4 * i + 3] != alpha[i];
    for (c = 0; c < 3; ++c) bad += fabsf(f32[4 * i + c] - over_black[3 * i + c]) > 1e-6f;
  }
  HOLD(bad == 0);
  HOLD(half > 10);
  other.premultiplied = 0, other.data = f16, other.type = VSPLAT_PIXELS_F16;
  EXPECT(VSPLAT_OK, vsplat_render(device, scene, &camera, &options, &other));
  other.data = rgba, other.type = VSPLAT_PIXELS_U8;
  EXPECT(VSPLAT_OK, vsplat_render(device, scene, &camera, &options, &other));
  other.data = f32, other.type = VSPLAT_PIXELS_F32;
  EXPECT(VSPLAT_OK, vsplat_render(device, scene, &camera, &options, &other));
  for (i = 0; i < PIXELS; ++i)
    for (c = 0; c < 4; ++c) {
      const float v = f32[4 * i + c], limited = v > 1 ? 1 : v > 0 ? v : 0;
      if (c < 3 && alpha[i] > 0.02f) bad += fabsf(v * alpha[i] - over_black[3 * i + c]) > 1e-5f;
      bad += rgba[4 * i + c] != (unsigned char)lroundf(255 * limited);
      if (v > 1e-4f) {
        const unsigned h = f16[4 * i + c];
        bad += fabsf(ldexpf((float)(1024 + (h & 1023)), (int)(h >> 10) - 25) - v) > v / 2048;
      }
    }
  HOLD(bad == 0);
  other.channels = 5;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render(device, scene, &camera, &options, &other));
  other.channels = 3, other.premultiplied = 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render(device, scene, &camera, &options, &other));
  other.premultiplied = 0, other.row_bytes = EDGE * 12 - 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render(device, scene, &camera, &options, &other));
  HOLD(strstr(vsplat_last_error(), "picture.row_bytes is 191") != NULL);
  other.row_bytes = 0, other.type = (vsplat_pixel_type)9;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render(device, scene, &camera, &options, &other));
  other.type = VSPLAT_PIXELS_F32;
  /* Rows too large for any memory. */
  for (i = 0; i < 6; ++i) {
    const size_t apart[] = {SIZE_MAX,
                            SIZE_MAX / 2,
                            SIZE_MAX / 2 - 4095,
                            SIZE_MAX / EDGE,
                            SIZE_MAX / 2 / (EDGE - 1) + 1,
                            SIZE_MAX / 2 / (EDGE - 1)};
    other.row_bytes = apart[i];
    EXPECT(VSPLAT_ERROR_USAGE, vsplat_render(device, scene, &camera, &options, &other));
    HOLD(strstr(vsplat_last_error(), "picture.row_bytes is ") != NULL);
    EXPECT(VSPLAT_ERROR_USAGE, vsplat_render_views(device, scene, &camera, 1, &options, &other));
  }
  /* The caller's byte count is respected. */
  other.row_bytes = EDGE * 12 + 4, other.data_bytes = (EDGE - 1) * (EDGE * 12 + 4) + EDGE * 12 - 1, other.capacity = 0;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render(device, scene, &camera, &options, &other));
  HOLD(strstr(vsplat_last_error(), "picture.data_bytes is 3131") != NULL);
  ++other.data_bytes;
  EXPECT(VSPLAT_OK, vsplat_render(device, scene, &camera, &options, &other));
  other.data_bytes = 0;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render(device, scene, &camera, &options, &other)); /* no size is given */
}

/* Each output has its own memory, and there is at least one. */
static void test_outputs(vsplat_device device, vsplat_scene scene) {
  static float all[8 * PIXELS];
  vsplat_camera cameras[2] = {VSPLAT_CAMERA_INIT, VSPLAT_CAMERA_INIT};
  vsplat_picture pictures[2] = {VSPLAT_PICTURE_INIT, VSPLAT_PICTURE_INIT};
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT, none = VSPLAT_GAUSSIANS_INIT;
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  double pose[6];
  int i;
  for (i = 0; i < 2; ++i) {
    cameras[i].width = cameras[i].height = EDGE;
    cameras[i].fx = cameras[i].fy = EDGE;
    cameras[i].w2c[11] = 2;
    pictures[i].capacity = PIXELS;
  }
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render(device, scene, cameras, NULL, pictures));
  HOLD(strstr(vsplat_last_error(), "there is nothing to draw into") != NULL);
  pictures[0].colour = all, pictures[0].depth = all + 3 * PIXELS - 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render(device, scene, cameras, NULL, pictures));
  HOLD(strstr(vsplat_last_error(), "picture.colour and picture.depth share memory") != NULL);
  pictures[0].depth = NULL;
  EXPECT(VSPLAT_OK, vsplat_render_views(device, scene, cameras, 2, NULL, pictures)); /* the second is not requested */
  pictures[0].ids = (int32_t*)all;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render_views(device, scene, cameras, 2, NULL, pictures));
  pictures[0].ids = NULL, pictures[1].alpha = all + 3 * PIXELS;
  EXPECT(VSPLAT_OK, vsplat_render_views(device, scene, cameras, 2, NULL, pictures));
  pictures[0].colour = pictures[1].alpha = NULL;
  /* Two pictures side by side in one frame with interleaved rows, and a plane in the gaps between the rows. */
  for (i = 0; i < 2; ++i) {
    pictures[i].data = (unsigned char*)all + i * EDGE * 3;
    pictures[i].type = VSPLAT_PIXELS_U8, pictures[i].row_bytes = 2 * EDGE * 3;
    pictures[i].data_bytes = sizeof all - EDGE * 3;
  }
  EXPECT(VSPLAT_OK, vsplat_render_views(device, scene, cameras, 2, NULL, pictures));
  pictures[0].alpha = all + 1; /* within the rows of `data` */
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render(device, scene, cameras, NULL, pictures));
  HOLD(strstr(vsplat_last_error(), "share memory") != NULL);
  pictures[0].alpha = NULL;
  memset(all, 0, sizeof all);
  EXPECT(VSPLAT_OK, vsplat_scene_get_info(scene, &info));
  HOLD(info.count * 4 <= 8 * PIXELS);
  arrays.capacity = none.capacity = info.count, arrays.means = all, arrays.rotations = all + 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_get_gaussians(scene, &arrays));
  HOLD(strstr(vsplat_last_error(), "arrays.means and arrays.rotations share memory") != NULL);
  pictures[0].colour = all;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render_backward(device, scene, cameras, NULL, pictures, &arrays, pose));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render_backward(device, scene, cameras, NULL, pictures, &none, NULL));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render_backward(device, scene, cameras, NULL, pictures, NULL, NULL));
  EXPECT(VSPLAT_OK, vsplat_render_backward(device, scene, cameras, NULL, pictures, &none, pose));
}

static void test_refusals(vsplat_device device, vsplat_scene scene) {
  static float pixels[PIXELS * 4];
  vsplat_view view = VSPLAT_VIEW_INIT;
  vsplat_views views = NULL;
  vsplat_picture picture = VSPLAT_PICTURE_INIT;
  view.camera.width = view.camera.height = EDGE;
  view.camera.fx = view.camera.fy = EDGE;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_views_create(&view, 1, &views)); /* no pixels */
  view.pixels = pixels, view.data = pixels;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_views_create(&view, 1, &views)); /* both */
  view.pixels = NULL, view.row_bytes = EDGE * 12 - 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_views_create(&view, 1, &views));
  HOLD(strstr(vsplat_last_error(), "views[0].row_bytes is 191") != NULL);
  view.row_bytes = SIZE_MAX / 2;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_views_create(&view, 1, &views));
  HOLD(strstr(vsplat_last_error(), "views[0].row_bytes is ") != NULL);
  view.row_bytes = 0, view.data_bytes = PIXELS * 12 - 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_views_create(&view, 1, &views));
  HOLD(strstr(vsplat_last_error(), "views[0].data_bytes is 3071") != NULL);
  view.data_bytes = 0, view.type = (vsplat_pixel_type)9;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_views_create(&view, 1, &views));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_views_create(&view, SIZE_MAX / 16, &views));
  view.type = VSPLAT_PIXELS_F32, view.premultiplied = 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_views_create(&view, 1, &views)); /* no alpha */
  view.premultiplied = 0, view.camera.lens = (vsplat_lens)5;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_views_create(&view, 1, &views));
  view.camera.lens = VSPLAT_LENS_FISHEYE, view.camera.lens_values[4] = 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_views_create(&view, 1, &views));
  HOLD(strstr(vsplat_last_error(), "lens_values[4]") != NULL);
  view.camera.lens_values[4] = 0, view.camera.lens_values[0] = NAN;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_views_create(&view, 1, &views));
  view.camera.lens_values[0] = 0.1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render(device, scene, &view.camera, NULL, &picture)); /* drawn as pinholes */
  HOLD(strstr(vsplat_last_error(), "pinhole") != NULL);
  HOLD(views == NULL);
}

/* The bytes that a file would hold. */
static int is_file(const char* name, const char* bytes, size_t size) {
  size_t there = 0;
  unsigned char* file = bytes_of(in_folder(name), &there);
  const int out = there > 0 && there == size && memcmp(file, bytes, size) == 0;
  free(file);
  return out;
}

static void test_files_to_memory(vsplat_model model, vsplat_scene scene) {
  static float colour[3 * PIXELS], alpha[PIXELS], depth[PIXELS];
  vsplat_picture picture = VSPLAT_PICTURE_INIT;
  char *bytes = NULL, *other = NULL;
  size_t size = 0;
  int i;
  EXPECT(VSPLAT_OK, vsplat_scene_save(scene, in_folder("one.ply")));
  EXPECT(VSPLAT_OK, vsplat_scene_save_memory(scene, &bytes, &size));
  HOLD(is_file("one.ply", bytes, size));
  vsplat_text_free(bytes);
  for (i = VSPLAT_DTYPE_F32; i <= VSPLAT_DTYPE_F16; ++i) {
    EXPECT(VSPLAT_OK, vsplat_model_save_as(model, in_folder("one.safetensors"), (vsplat_dtype)i));
    EXPECT(VSPLAT_OK, vsplat_model_save_memory(model, (vsplat_dtype)i, &bytes, &size));
    HOLD(is_file("one.safetensors", bytes, size));
    vsplat_text_free(bytes);
  }
  for (i = 0; i < PIXELS; ++i) {
    alpha[i] = (float)(i % 7) / 6, depth[i] = 2 * alpha[i];
    colour[3 * i] = alpha[i] * 0.5f, colour[3 * i + 1] = 0, colour[3 * i + 2] = alpha[i];
  }
  picture.capacity = PIXELS, picture.colour = colour, picture.alpha = alpha, picture.depth = depth;
  for (i = VSPLAT_PICTURE_PNG; i <= VSPLAT_PICTURE_PNG_ALPHA; ++i) {
    const vsplat_picture_format format = (vsplat_picture_format)i;
    EXPECT(VSPLAT_OK, vsplat_picture_save(&picture, EDGE, EDGE, format, in_folder("one.picture")));
    EXPECT(VSPLAT_OK, vsplat_picture_save_memory(&picture, EDGE, EDGE, format, &bytes, &size));
    HOLD(is_file("one.picture", bytes, size));
    vsplat_text_free(bytes);
  }
  bytes = NULL;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_picture_save_memory(&picture, EDGE, EDGE, (vsplat_picture_format)9, &other, &size));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_model_save_memory(model, (vsplat_dtype)9, &other, &size));
  HOLD(other == NULL);
  EXPECT(VSPLAT_OK, vsplat_scene_save(scene, in_folder("two.ply"))); /* files work again */
  HOLD(access(in_folder("two.ply"), F_OK) == 0);
}

static vsplat_scene test_files_in_memory(vsplat_device device, vsplat_model model) {
  vsplat_reconstruct_options options = some_voxels();
  vsplat_model again = NULL, none = NULL;
  vsplat_model_info info = VSPLAT_MODEL_INFO_INIT;
  vsplat_input input = make_input(model, EDGE);
  vsplat_scene scene = NULL, other = NULL, read = NULL, from_file = NULL;
  unsigned char* bytes;
  size_t size = 0, n;
  EXPECT(VSPLAT_OK, vsplat_model_save(model, in_folder("model.safetensors")));
  bytes = bytes_of(in_folder("model.safetensors"), &size);
  EXPECT(VSPLAT_OK, vsplat_model_load_memory(bytes, size, &again));
  EXPECT(VSPLAT_OK, vsplat_model_get_info(again, &info));
  HOLD(info.hash == VSPLAT_HASH_VERIFIED);
  for (n = 0; n < size; n += 1 + size / 7) EXPECT(VSPLAT_ERROR_FORMAT, vsplat_model_load_memory(bytes, n, &none));
  bytes[size - 1] ^= 1;
  EXPECT(VSPLAT_ERROR_FORMAT, vsplat_model_load_memory(bytes, size, &none)); /* its hash */
  HOLD(strstr(vsplat_last_error(), "the model in memory") != NULL);
  free(bytes);
  EXPECT(VSPLAT_OK, vsplat_reconstruct(device, model, input, &options, &scene));
  EXPECT(VSPLAT_OK, vsplat_reconstruct(device, again, input, &options, &other));
  HOLD(are_equal(scene, other));
  EXPECT(VSPLAT_OK, vsplat_scene_save(scene, in_folder("scene.ply")));
  bytes = bytes_of(in_folder("scene.ply"), &size);
  EXPECT(VSPLAT_OK, vsplat_scene_load_memory(bytes, size, NULL, &read));
  EXPECT(VSPLAT_OK, vsplat_scene_load(in_folder("scene.ply"), &from_file));
  HOLD(are_equal(read, from_file));
  for (n = 0; n < size; n += 1 + size / 7) {
    vsplat_scene cut = NULL;
    EXPECT(VSPLAT_ERROR_FORMAT, vsplat_scene_load_memory(bytes, n, NULL, &cut));
  }
  HOLD(strstr(vsplat_last_error(), "the scene in memory") != NULL);
  free(bytes);
  vsplat_scene_release(from_file);
  vsplat_scene_release(other);
  vsplat_scene_release(read);
  vsplat_input_release(input);
  vsplat_model_release(again);
  return scene;
}

int main(void) {
  vsplat_device device = NULL;
  vsplat_model model = make_model("micro", 1);
  vsplat_scene scene;
  char remove_all[300];
  if (!mkdtemp(folder)) return 1;
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &device));
  test_pixels(model);
  test_lenses(model);
  scene = test_files_in_memory(device, model);
  test_files_to_memory(model, scene);
  test_pictures_out(device, scene);
  test_outputs(device, scene);
  test_refusals(device, scene);
  vsplat_scene_release(scene);
  vsplat_model_release(model);
  vsplat_device_release(device);
  snprintf(remove_all, sizeof remove_all, "rm -r %s", folder);
  if (system(remove_all) != 0) ++failures;
  if (failures == 0) printf("ok\n");
  return failures != 0;
}
