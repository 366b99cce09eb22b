/* A scene of small balls, in arrays and as the library holds it. `count` is defined before this is included. */
#ifndef VSPLAT_TESTS_API_BALL_SCENE_H
#define VSPLAT_TESTS_API_BALL_SCENE_H
#include "checks.h"

static float means[3 * count], scales[3 * count], rotations[4 * count], opacities[count], sh[3 * count];

static vsplat_scene_info scene_info(void) {
  vsplat_scene_info out = VSPLAT_SCENE_INFO_INIT;
  out.count = count;
  return out;
}

/* The balls are in a cube about (0, 0, z). */
static vsplat_scene make_scene(float z) {
  const vsplat_scene_info info = scene_info();
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
  vsplat_scene out = NULL;
  int i, c;
  for (i = 0; i < count; ++i) {
    rotations[4 * i] = 1;
    opacities[i] = 0.1f + 0.8f * (float)(i * 31 % 17) / 17;
    for (c = 0; c < 3; ++c) {
      means[3 * i + c] = (float)(i * (919 + 210 * c) % 1000) / 1000 - 0.5f + (c == 2 ? z : 0.0f);
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

#endif
