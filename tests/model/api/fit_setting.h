/* Shared by the tests of refinement: a scene, pictures of it in memory, and a start. */
#ifndef VSPLAT_TESTS_API_REFINE_SETTING_H
#define VSPLAT_TESTS_API_REFINE_SETTING_H
#include <math.h>
#include <vsplat/vsplat.h>

#include "checks.h"

enum { side = 24, pixels = side * side, views = 6, count = 20 };

static vsplat_device open_device(void) {
  vsplat_device out = NULL;
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &out));
  return out;
}

/* Balls in a spiral, coloured or grey; or discs. */
static vsplat_scene make_shapes(int coloured, int surfels) {
  static float means[3 * count], scales[3 * count], rotations[4 * count], opacities[count], sh[3 * count];
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
  vsplat_scene out = NULL;
  int i, c;
  for (i = 0; i < count; ++i) {
    means[3 * i] = 0.3f * (float)sin(i), means[3 * i + 1] = 0.3f * (float)cos(i);
    means[3 * i + 2] = 0.03f * (float)(i - count / 2);
    rotations[4 * i] = 1;
    opacities[i] = 0.8f;
    for (c = 0; c < 3; ++c) {
      scales[3 * i + c] = 0.08f;
      sh[3 * i + c] = coloured ? 1.5f * (float)sin(1.7 * i + 2 * c) : 0;
    }
  }
  info.count = arrays.capacity = count;
  info.near_plane = 0.1;
  arrays.means = means, arrays.scales = scales, arrays.rotations = rotations;
  arrays.opacities = opacities, arrays.sh = sh;
  for (i = 0; surfels && i < count; ++i) scales[3 * i + 2] = 0;
  info.surfels = surfels;
  EXPECT(VSPLAT_OK, vsplat_scene_create(&info, &arrays, &out));
  return out;
}

static vsplat_scene make_scene(int coloured) { return make_shapes(coloured, 0); }

/* Camera `i` on a circle about the origin, at a distance of 2. */
static vsplat_camera make_camera(int i) {
  vsplat_camera out = VSPLAT_CAMERA_INIT;
  const double a = 1.05 * i, s = sin(a), c = cos(a);
  out.width = out.height = side;
  out.fx = out.fy = 30;
  out.cx = out.cy = side / 2.0;
  out.w2c[0] = c, out.w2c[2] = s;
  out.w2c[8] = -s, out.w2c[10] = c;
  out.w2c[11] = 2;
  return out;
}

static vsplat_views make_views(vsplat_device device) {
  static float pictures[views][3 * pixels];
  vsplat_view list[views];
  vsplat_scene truth = make_scene(1);
  vsplat_views out = NULL;
  int i;
  for (i = 0; i < views; ++i) {
    const vsplat_view init = VSPLAT_VIEW_INIT;
    vsplat_picture picture = VSPLAT_PICTURE_INIT;
    list[i] = init;
    list[i].camera = make_camera(i);
    list[i].pixels = pictures[i];
    picture.capacity = pixels;
    picture.colour = pictures[i];
    EXPECT(VSPLAT_OK, vsplat_render(device, truth, &list[i].camera, NULL, &picture));
  }
  EXPECT(VSPLAT_OK, vsplat_views_create(list, views, &out));
  vsplat_scene_release(truth);
  return out;
}

static vsplat_fit_options make_options(vsplat_scene start) {
  vsplat_fit_options out = VSPLAT_FIT_OPTIONS_INIT;
  out.scene = start;
  out.holdout = VSPLAT_HOLDOUT_COUNT;
  out.holdout_count = 1;
  out.steps = 200;
  return out;
}

#endif
