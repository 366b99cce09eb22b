/* Edits scenes in place: several in one picture, transformed, with Gaussians removed, within a box. Prints every
   check that fails; exits 1 if any did. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "checks.h"

enum { EDGE = 48, PIXELS = EDGE * EDGE, MOST = 64 };

typedef struct values {
  uint64_t count;
  float means[3 * MOST], scales[3 * MOST], rotations[4 * MOST], opacities[MOST], sh[48 * MOST];
} values;

static float random_number(uint32_t* state) {
  *state = *state * 1664525u + 1013904223u;
  return (float)(*state >> 8) / 16777216.0f;
}

static vsplat_scene make_scene(uint64_t count, int degree, uint32_t seed, int has_mirror, const double* offset) {
  static values v;
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
  vsplat_scene out = NULL;
  size_t i;
  const size_t functions = (size_t)((degree + 1) * (degree + 1));
  for (i = 0; i < 3 * count; ++i) {
    v.means[i] = random_number(&seed) - 0.5f;
    v.scales[i] = 0.03f + 0.1f * random_number(&seed);
  }
  for (i = 0; i < 4 * count; ++i) v.rotations[i] = random_number(&seed) - 0.4f;
  for (i = 0; i < count; ++i) v.opacities[i] = 0.3f + 0.6f * random_number(&seed);
  for (i = 0; i < 3 * functions * count; ++i) v.sh[i] = random_number(&seed) - 0.5f;
  info.count = arrays.capacity = count;
  info.sh_degree = degree;
  info.has_mirror = has_mirror;
  if (offset) memcpy(info.offset, offset, sizeof info.offset);
  arrays.means = v.means, arrays.scales = v.scales, arrays.rotations = v.rotations;
  arrays.opacities = v.opacities, arrays.sh = v.sh;
  EXPECT(VSPLAT_OK, vsplat_scene_create(&info, &arrays, &out));
  return out;
}

static vsplat_scene_info info_of(vsplat_scene scene) {
  vsplat_scene_info out = VSPLAT_SCENE_INFO_INIT;
  EXPECT(VSPLAT_OK, vsplat_scene_get_info(scene, &out));
  return out;
}

static values values_of(vsplat_scene scene) {
  values out;
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
  memset(&out, 0, sizeof out);
  out.count = info_of(scene).count;
  HOLD(out.count <= MOST);
  arrays.capacity = MOST;
  arrays.means = out.means, arrays.scales = out.scales, arrays.rotations = out.rotations;
  arrays.opacities = out.opacities, arrays.sh = out.sh;
  EXPECT(VSPLAT_OK, vsplat_scene_get_gaussians(scene, &arrays));
  return out;
}

typedef struct drawn {
  float colour[3 * PIXELS], alpha[PIXELS];
} drawn;

/* A camera at (x, y, -4), or, with `moved`, where that transform takes this camera. */
static vsplat_camera camera_at(double x, double y, const double* moved, double scale) {
  vsplat_camera out = VSPLAT_CAMERA_INIT;
  int i, j, k;
  out.width = out.height = EDGE;
  out.fx = out.fy = EDGE;
  out.cx = out.cy = EDGE / 2.0;
  out.w2c[3] = -x, out.w2c[7] = -y, out.w2c[11] = 4;
  if (!moved) return out;
  /* w2c' (s R x + t) = s w2c x: rotation R_w R^T, and translation s times the original minus that of t. */
  {
    double rotation[9], shift[3];
    for (i = 0; i < 3; ++i) {
      for (j = 0; j < 3; ++j) {
        rotation[3 * i + j] = 0;
        for (k = 0; k < 3; ++k) rotation[3 * i + j] += out.w2c[4 * i + k] * moved[4 * j + k] / scale;
      }
      shift[i] = scale * out.w2c[4 * i + 3];
      for (j = 0; j < 3; ++j) shift[i] -= rotation[3 * i + j] * moved[4 * j + 3];
    }
    for (i = 0; i < 3; ++i) {
      for (j = 0; j < 3; ++j) out.w2c[4 * i + j] = rotation[3 * i + j];
      out.w2c[4 * i + 3] = shift[i];
    }
  }
  return out;
}

static void draw(vsplat_device device, vsplat_scene scene, const vsplat_camera* camera, drawn* out) {
  vsplat_picture picture = VSPLAT_PICTURE_INIT;
  vsplat_render_options options = VSPLAT_RENDER_OPTIONS_INIT;
  options.supersample = 1;
  picture.capacity = PIXELS, picture.colour = out->colour, picture.alpha = out->alpha;
  EXPECT(VSPLAT_OK, vsplat_render(device, scene, camera, &options, &picture));
}

static float difference(const drawn* a, const drawn* b) {
  float out = 0;
  int i;
  for (i = 0; i < 3 * PIXELS; ++i) out = fmaxf(out, fabsf(a->colour[i] - b->colour[i]));
  for (i = 0; i < PIXELS; ++i) out = fmaxf(out, fabsf(a->alpha[i] - b->alpha[i]));
  return out;
}

static float most(const drawn* a) {
  float out = 0;
  int i;
  for (i = 0; i < PIXELS; ++i) out = fmaxf(out, a->alpha[i]);
  return out;
}

/* Scales by 2, rotates by 90 degrees about z, and translates: (x, y, z) -> (-2y + 1, 2x + 3, 2z - 2). */
static const double turned[16] = {0, -2, 0, 1, 2, 0, 0, 3, 0, 0, 2, -2, 0, 0, 0, 1};

static void test_transform(vsplat_device device) {
  static drawn before, after;
  const double far_off[3] = {4e6, -3e6, 1e6};
  int degree, is_far;
  for (degree = 0; degree <= 3; ++degree)
    for (is_far = 0; is_far < 2; ++is_far) {
      const double* offset = is_far ? far_off : NULL;
      vsplat_scene scene = make_scene(20, degree, 3, degree & 1, offset);
      vsplat_camera here = camera_at(is_far ? far_off[0] : 0.1, is_far ? far_off[1] : -0.2, NULL, 1), there;
      if (is_far) here.w2c[11] -= far_off[2];
      there = here;
      {
        vsplat_camera moved = camera_at(here.w2c[3] * -1, here.w2c[7] * -1, turned, 2);
        if (is_far) { /* the same with that third translation */
          moved.w2c[11] = 2 * here.w2c[11] - turned[11];
        }
        there = moved;
      }
      draw(device, scene, &here, &before);
      HOLD(most(&before) > 0.5f);
      EXPECT(VSPLAT_OK, vsplat_scene_transform(scene, turned));
      HOLD(fabs(info_of(scene).near_plane - 0.4) < 1e-6);
      draw(device, scene, &there, &after);
      HOLD(difference(&before, &after) < 2e-3f);
      vsplat_scene_release(scene);
    }
}

/* Two scenes that do not overlap in the picture: each looks as it does alone. */
static void test_append(vsplat_device device) {
  static drawn both, first, second;
  const double aside[16] = {1, 0, 0, 1.0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  vsplat_scene one = make_scene(20, 1, 3, 0, NULL), two = make_scene(30, 3, 4, 0, NULL),
               none = make_scene(0, 0, 0, 0, NULL);
  vsplat_camera camera = camera_at(0.5, 0, NULL, 1);
  values a = values_of(one), b = values_of(two), all;
  int x, i, bad = 0;
  EXPECT(VSPLAT_OK, vsplat_scene_transform(two, aside));
  draw(device, one, &camera, &first);
  draw(device, two, &camera, &second);
  EXPECT(VSPLAT_OK, vsplat_scene_append(none, one, NULL));
  EXPECT(VSPLAT_OK, vsplat_scene_append(none, two, NULL));
  HOLD(info_of(none).count == 50 && info_of(none).sh_degree == 3);
  all = values_of(none);
  HOLD(memcmp(all.means, a.means, sizeof(float) * 60) == 0);
  HOLD(memcmp(all.opacities + 20, b.opacities, sizeof(float) * 30) == 0);
  HOLD(memcmp(all.scales + 60, b.scales, sizeof(float) * 90) == 0);
  for (i = 0; i < 20; ++i) { /* four coefficients, and zeros */
    bad += memcmp(all.sh + 48 * i, a.sh + 12 * i, sizeof(float) * 12) != 0;
    for (x = 12; x < 48; ++x) bad += all.sh[48 * i + x] != 0;
  }
  HOLD(bad == 0);
  draw(device, none, &camera, &both);
  HOLD(most(&first) > 0.5f && most(&second) > 0.5f);
  for (i = 0, bad = 0, x = 0; i < PIXELS; ++i) {
    const float other = fminf(first.alpha[i], second.alpha[i]);
    if (other > 0) continue;
    ++x;
    bad += fabsf(both.alpha[i] - fmaxf(first.alpha[i], second.alpha[i])) > 1e-5f;
    bad += fabsf(both.colour[3 * i] - (first.alpha[i] > 0 ? first : second).colour[3 * i]) > 1e-5f;
  }
  HOLD(bad == 0);
  HOLD(x > PIXELS / 2);
  EXPECT(VSPLAT_OK, vsplat_scene_append(none, none, aside)); /* itself */
  HOLD(info_of(none).count == 100);
  HOLD(info_of(one).count == 20);
  vsplat_scene_release(one);
  vsplat_scene_release(two);
  vsplat_scene_release(none);
}

/* A mirror point that both scenes share, and one that is lost: from far away the colours stay the same. */
static void test_mirrors(vsplat_device device) {
  static drawn before, after;
  vsplat_scene one = make_scene(20, 3, 5, 1, NULL), same = make_scene(1, 0, 6, 1, NULL),
               other = make_scene(1, 0, 6, 0, NULL);
  vsplat_camera camera = camera_at(0, 0, NULL, 1);
  const uint8_t gone[22] = {0};
  uint8_t last[22] = {0};
  EXPECT(VSPLAT_OK, vsplat_scene_append(one, same, NULL));
  HOLD(info_of(one).has_mirror == 1);
  camera.w2c[11] = 400, camera.fx = camera.fy = 100.0 * EDGE;
  draw(device, one, &camera, &before);
  EXPECT(VSPLAT_OK, vsplat_scene_append(one, other, NULL));
  HOLD(info_of(one).has_mirror == 0);
  EXPECT(VSPLAT_OK, vsplat_scene_remove(one, gone, 22));
  HOLD(info_of(one).count == 22);
  last[21] = 1;
  EXPECT(VSPLAT_OK, vsplat_scene_remove(one, last, 22));
  draw(device, one, &camera, &after);
  HOLD(most(&before) > 0.5f);
  HOLD(difference(&before, &after) < 0.02f);
  vsplat_scene_release(one);
  vsplat_scene_release(same);
  vsplat_scene_release(other);
}

/* Anti-aliasing is kept by every edit and by files; only volumes have it. */
static void test_antialias(void) {
  const double low[3] = {-1, -1, -1}, high[3] = {1, 1, 1};
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
  vsplat_scene scene = NULL, again = NULL, plain = make_scene(3, 0, 8, 0, NULL);
  values v = values_of(plain);
  uint8_t removed[6] = {0};
  char* bytes = NULL;
  size_t size = 0;
  arrays.capacity = info.count = 3;
  arrays.means = v.means, arrays.scales = v.scales, arrays.rotations = v.rotations;
  arrays.opacities = v.opacities, arrays.sh = v.sh;
  info.antialias = 2;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_create(&info, &arrays, &scene));
  info.antialias = info.surfels = 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_create(&info, &arrays, &scene));
  info.surfels = 0;
  EXPECT(VSPLAT_OK, vsplat_scene_create(&info, &arrays, &scene));
  EXPECT(VSPLAT_OK, vsplat_scene_transform(scene, turned));
  EXPECT(VSPLAT_OK, vsplat_scene_append(scene, plain, NULL));
  EXPECT(VSPLAT_OK, vsplat_scene_append(plain, scene, NULL));
  HOLD(info_of(scene).antialias == 1 && info_of(plain).antialias == 0);
  EXPECT(VSPLAT_OK, vsplat_scene_remove(scene, removed, 6));
  EXPECT(VSPLAT_OK, vsplat_scene_crop(scene, low, high));
  EXPECT(VSPLAT_OK, vsplat_scene_save_memory(scene, &bytes, &size));
  EXPECT(VSPLAT_OK, vsplat_scene_load_memory(bytes, size, NULL, &again));
  HOLD(info_of(again).antialias == 1);
  vsplat_text_free(bytes);
  vsplat_scene_release(scene);
  vsplat_scene_release(again);
  vsplat_scene_release(plain);
}

static int is_there(const char* path) {
  FILE* file = fopen(path, "rb");
  if (file) fclose(file);
  return file != NULL;
}

static void write_file(const char* path, const char* text) {
  FILE* file = fopen(path, "wb");
  HOLD(file != NULL);
  if (!file) return;
  fputs(text, file);
  fclose(file);
}

/* A file beside the scene states its position for other programs. */
static void test_offset_file(void) {
  const char *path = "edit_test_far.ply", *beside = "edit_test_far.offset.json";
  const double offset[3] = {1e6, 0.5, -3};
  vsplat_scene far_off = make_scene(3, 0, 5, 0, offset), near_by = make_scene(3, 0, 5, 0, NULL);
  char text[256] = "";
  FILE* file;
  remove(beside);
  EXPECT(VSPLAT_OK, vsplat_scene_save(far_off, path));
  file = fopen(beside, "rb");
  HOLD(file != NULL);
  if (file) {
    text[fread(text, 1, sizeof text - 1, file)] = 0;
    fclose(file);
  }
  HOLD(strstr(text, "edit_test_far.ply") && strstr(text, "1000000.0") && strstr(text, "0.5") && strstr(text, "-3.0"));
  EXPECT(VSPLAT_OK, vsplat_scene_save(near_by, path));
  HOLD(!is_there(beside));
  write_file(beside, "{\"scene\": \"another.ply\", \"offset\": [1, 2, 3]}");
  EXPECT(VSPLAT_OK, vsplat_scene_save(near_by, path));
  HOLD(is_there(beside)); /* it does not belong to this scene */
  remove(beside);
  remove(path);
  vsplat_scene_release(far_off);
  vsplat_scene_release(near_by);
}

static void test_fewer(void) {
  const double offset[3] = {10, 20, 30}, low[3] = {9.9, 19.5, 29}, high[3] = {10.5, 20.2, 31};
  vsplat_scene scene = make_scene(40, 2, 7, 0, offset);
  const values before = values_of(scene);
  values after;
  uint8_t removed[40];
  size_t i, kept = 0, bad = 0;
  for (i = 0; i < 40; ++i) removed[i] = i % 3 == 1 ? 77 : 0;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_remove(scene, removed, 39));
  EXPECT(VSPLAT_OK, vsplat_scene_remove(scene, removed, 40));
  after = values_of(scene);
  for (i = 0; i < 40; ++i) {
    if (removed[i]) continue;
    bad += memcmp(before.means + 3 * i, after.means + 3 * kept, 12) != 0;
    bad += memcmp(before.scales + 3 * i, after.scales + 3 * kept, 12) != 0;
    bad += memcmp(before.rotations + 4 * i, after.rotations + 4 * kept, 16) != 0;
    bad += before.opacities[i] != after.opacities[kept];
    bad += memcmp(before.sh + 27 * i, after.sh + 27 * kept, 27 * sizeof(float)) != 0;
    ++kept;
  }
  HOLD(bad == 0 && after.count == kept);
  EXPECT(VSPLAT_OK, vsplat_scene_crop(scene, low, high));
  for (i = 0, kept = 0; i < after.count; ++i) {
    const float* m = after.means + 3 * i;
    kept += m[0] >= -0.1 && m[0] <= 0.5 && m[1] >= -0.5 && m[1] <= 0.2;
  }
  HOLD(kept > 0 && kept < after.count);
  HOLD(info_of(scene).count == kept);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_crop(scene, high, low));
  HOLD(info_of(scene).count == kept);
  vsplat_scene_release(scene);
}

static void test_refusals(void) {
  double bad[16];
  int i;
  vsplat_scene scene = make_scene(2, 0, 7, 0, NULL);
  const double mirrored[16] = {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  const double sheared[16] = {1, 0.5, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  const double infinite[16] = {1, 0, 0, 1e39, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  const values before = values_of(scene);
  values after;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_transform(scene, mirrored));
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_transform(scene, sheared));
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_transform(scene, infinite));
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_append(scene, scene, infinite));
  for (i = 0; i < 16; ++i) {
    memcpy(bad, turned, sizeof bad);
    bad[i] = NAN;
    EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_transform(scene, bad));
    EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_append(scene, scene, bad));
  }
  after = values_of(scene);
  HOLD(memcmp(&before, &after, sizeof before) == 0);
  vsplat_scene_release(scene);
}

int main(void) {
  vsplat_device device = NULL;
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &device));
  test_transform(device);
  test_append(device);
  test_mirrors(device);
  test_antialias();
  test_offset_file();
  test_fewer();
  test_refusals();
  vsplat_device_release(device);
  if (failures == 0) printf("ok\n");
  return failures != 0;
}
