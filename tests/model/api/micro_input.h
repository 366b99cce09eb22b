/* Two views of an object in memory, one grey and one coloured, a model that accepts them, and its options. */
#ifndef VSPLAT_TESTS_API_MICRO_INPUT_H
#define VSPLAT_TESTS_API_MICRO_INPUT_H
#include <stdlib.h>
#include <string.h>

#include "checks.h"

static vsplat_model make_model(const char* config, uint64_t seed) {
  vsplat_model_options options = VSPLAT_MODEL_OPTIONS_INIT;
  vsplat_model out = NULL;
  options.config = config;
  options.seed = seed;
  EXPECT(VSPLAT_OK, vsplat_model_init(&options, &out));
  return out;
}

/* From the front and from behind, `edge` pixels to a side. */
static vsplat_input make_input(vsplat_model model, int edge) {
  const size_t values = (size_t)edge * (size_t)edge * 3;
  float* pixels = malloc(values * sizeof(float));
  vsplat_view all[2] = {VSPLAT_VIEW_INIT, VSPLAT_VIEW_INIT};
  vsplat_views views = NULL;
  vsplat_input out = NULL;
  size_t i;
  for (i = 0; i < values; ++i) pixels[i] = (float)(i * 7919 % 101) / 101.0f;
  for (i = 0; i < 2; ++i) {
    vsplat_camera* camera = &all[i].camera;
    all[i].pixels = pixels;
    camera->width = camera->height = edge;
    camera->fx = camera->fy = 1.25 * edge;
    camera->cx = camera->cy = edge / 2.0;
    camera->w2c[0] = camera->w2c[10] = i ? -1 : 1;
    camera->w2c[11] = 2;
  }
  EXPECT(VSPLAT_OK, vsplat_views_create(all, 2, &views));
  EXPECT(VSPLAT_OK, vsplat_input_prepare(model, views, NULL, &out));
  vsplat_views_release(views);
  free(pixels);
  return out;
}

/* Voxels that are used regardless of what a random network selects. */
static vsplat_reconstruct_options some_voxels(void) {
  static const int32_t voxels[] = {3, 21, 40};
  vsplat_reconstruct_options out = VSPLAT_RECONSTRUCT_OPTIONS_INIT;
  out.voxels = voxels;
  out.num_voxels = 3;
  return out;
}

/* All spherical harmonics of a scene; the caller frees them. */
static float* values_of(vsplat_scene scene, size_t* out_bytes) {
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
  EXPECT(VSPLAT_OK, vsplat_scene_get_info(scene, &info));
  *out_bytes = info.count * 3 * (size_t)((info.sh_degree + 1) * (info.sh_degree + 1)) * sizeof(float);
  arrays.capacity = info.count;
  arrays.sh = malloc(*out_bytes);
  EXPECT(VSPLAT_OK, vsplat_scene_get_gaussians(scene, &arrays));
  return arrays.sh;
}

static int are_equal(vsplat_scene a, vsplat_scene b) {
  size_t na = 0, nb = 0;
  float *x = values_of(a, &na), *y = values_of(b, &nb);
  const int out = na > 0 && na == nb && memcmp(x, y, na) == 0;
  free(x);
  free(y);
  return out;
}

#endif
