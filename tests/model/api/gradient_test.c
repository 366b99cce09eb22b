/* Creates scenes from a caller's arrays, changes, draws and differentiates them, in plain C. Prints every check
   that fails; exits 1 if any did. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <vsplat/vsplat.h>

#include "checks.h"

enum { count = 2, coefficients = 4 };

/* A caller's arrays with two Gaussians in front of the camera and space for a third. They fill the picture, so
   that no pixel is at the edge of one, where its value would jump. */
typedef struct values {
  float means[9], scales[9], rotations[12], opacities[3], sh[3 * coefficients * 3];
} values;

static values make_values(void) {
  values v;
  int i;
  memset(&v, 0, sizeof v);
  for (i = 0; i < count; ++i) {
    v.means[3 * i] = 0.2f * (float)i - 0.1f;
    v.means[3 * i + 2] = 2.0f + (float)i;
    v.scales[3 * i] = 0.7f, v.scales[3 * i + 1] = 0.6f, v.scales[3 * i + 2] = 0.65f;
    v.rotations[4 * i] = 1.5f, v.rotations[4 * i + 2] = 0.5f;
    v.opacities[i] = 0.6f;
  }
  for (i = 0; i < count * coefficients * 3; ++i) v.sh[i] = 0.1f * (float)(i % 7);
  return v;
}

static vsplat_gaussians arrays_of(values* v) {
  vsplat_gaussians out = VSPLAT_GAUSSIANS_INIT;
  out.capacity = 3;
  out.means = v->means;
  out.scales = v->scales;
  out.rotations = v->rotations;
  out.opacities = v->opacities;
  out.sh = v->sh;
  return out;
}

static vsplat_scene make_scene(values* v) {
  vsplat_scene scene = NULL;
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  const vsplat_gaussians arrays = arrays_of(v);
  info.count = count;
  info.sh_degree = 1;
  EXPECT(VSPLAT_OK, vsplat_scene_create(&info, &arrays, &scene));
  return scene;
}

/* Inputs that vsplat_scene_create refuses, and the message of each. */
static void refuses_bad_values(void) {
  values v = make_values();
  vsplat_scene scene = NULL;
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  vsplat_gaussians arrays = arrays_of(&v);
  info.count = count;
  info.sh_degree = 5;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_create(&info, &arrays, &scene));
  info.sh_degree = 1;
  info.near_plane = -1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_create(&info, &arrays, &scene));
  info.near_plane = 0;
  info.count = 4;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_create(&info, &arrays, &scene)); /* capacity for 3 */
  info.surfels = 2;
  info.count = count;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_create(&info, &arrays, &scene));
  HOLD(strstr(vsplat_last_error(), "info.surfels") != NULL);
  info.surfels = 0;
  info.count = UINT64_MAX;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_create(&info, &arrays, &scene));
  info.count = count;
  arrays.sh = NULL;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_create(&info, &arrays, &scene));
  arrays.sh = v.sh;
  v.means[4] = NAN;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_create(&info, &arrays, &scene));
  HOLD(strstr(vsplat_last_error(), "arrays.means") && strstr(vsplat_last_error(), "value 1 of Gaussian 1"));
  v.means[4] = 0;
  v.scales[0] = -1;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_create(&info, &arrays, &scene));
  v.scales[0] = 1;
  v.opacities[1] = 1.5f;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_create(&info, &arrays, &scene));
  v.opacities[1] = 1;
  v.rotations[0] = v.rotations[2] = 0;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_create(&info, &arrays, &scene));
  v.rotations[0] = 1;
  v.sh[23] = INFINITY;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_create(&info, &arrays, &scene));
  v.sh[24] = v.sh[23]; /* of the third, which is not used */
  v.sh[23] = 0;
  info.has_mirror = 1;
  info.mirror[2] = NAN;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_create(&info, &arrays, &scene));
  HOLD(!scene);
  info.mirror[2] = 3;
  info.up[1] = INFINITY;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_create(&info, &arrays, &scene));
  info.up[1] = -2;
  info.detail_pixel = -0.5;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_create(&info, &arrays, &scene));
  HOLD(strstr(vsplat_last_error(), "info.detail_pixel is -0.5") != NULL);
  info.detail_pixel = NAN;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_create(&info, &arrays, &scene));
  info.detail_pixel = 0.25;
  info.detail_middle[2] = INFINITY;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_create(&info, &arrays, &scene));
  HOLD(strstr(vsplat_last_error(), "info.detail_middle[2]") != NULL);
  info.detail_middle[2] = 1.5;
  EXPECT(VSPLAT_OK, vsplat_scene_create(&info, &arrays, &scene));
  memset(&info, 0, sizeof info);
  info.size = sizeof info;
  EXPECT(VSPLAT_OK, vsplat_scene_get_info(scene, &info));
  HOLD(info.detail_pixel == 0.25 && info.detail_middle[0] == 0 && info.detail_middle[2] == 1.5);
  HOLD(info.count == count && info.has_mirror && info.mirror[2] == 3 && fabs(info.near_plane - 0.2) < 1e-6);
  HOLD(info.up[0] == 0 && info.up[1] == -1 && info.up[2] == 0);
  vsplat_scene_release(scene);
  info.count = 0;
  memset(&arrays, 0, sizeof arrays);
  arrays.size = sizeof arrays;
  scene = NULL;
  EXPECT(VSPLAT_OK, vsplat_scene_create(&info, &arrays, &scene)); /* an empty scene is valid */
  vsplat_scene_release(scene);
}

static void update_replaces_what_is_given(void) {
  values v = make_values(), got;
  vsplat_scene scene = make_scene(&v);
  vsplat_gaussians some = VSPLAT_GAUSSIANS_INIT, all = arrays_of(&got);
  float opacities[count] = {0.25f, 0.5f};
  some.capacity = count;
  some.opacities = opacities;
  EXPECT(VSPLAT_OK, vsplat_scene_update(scene, &some));
  EXPECT(VSPLAT_OK, vsplat_scene_get_gaussians(scene, &all));
  HOLD(memcmp(got.opacities, opacities, sizeof opacities) == 0);
  HOLD(memcmp(got.means, v.means, sizeof(float) * 3 * count) == 0);
  HOLD(memcmp(got.rotations, v.rotations, sizeof(float) * 4 * count) == 0); /* not normalised */
  HOLD(memcmp(got.sh, v.sh, sizeof(float) * 3 * coefficients * count) == 0);
  some.capacity = count - 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_update(scene, &some));
  some.capacity = count;
  opacities[1] = NAN;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_update(scene, &some));
  EXPECT(VSPLAT_OK, vsplat_scene_get_gaussians(scene, &all));
  HOLD(got.opacities[0] == 0.25f && got.opacities[1] == 0.5f); /* unchanged */
  vsplat_scene_release(scene);
}

/* The third scale exists and is 0, in input and output. */
static void surfels_are_flat(void) {
  values v = make_values(), got;
  vsplat_scene scene = NULL;
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  vsplat_gaussians arrays = arrays_of(&v), out = arrays_of(&got);
  info.count = count;
  info.sh_degree = 1;
  info.surfels = 1;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_create(&info, &arrays, &scene));
  HOLD(strstr(vsplat_last_error(), "arrays.scales") && strstr(vsplat_last_error(), "value 2 of Gaussian 0"));
  v.scales[2] = v.scales[5] = 0;
  EXPECT(VSPLAT_OK, vsplat_scene_create(&info, &arrays, &scene));
  info.surfels = 0;
  EXPECT(VSPLAT_OK, vsplat_scene_get_info(scene, &info));
  HOLD(info.surfels == 1);
  memset(&got, 0x7f, sizeof got);
  EXPECT(VSPLAT_OK, vsplat_scene_get_gaussians(scene, &out));
  HOLD(memcmp(got.scales, v.scales, sizeof(float) * 3 * count) == 0);
  HOLD(memcmp(got.sh, v.sh, sizeof(float) * 3 * coefficients * count) == 0);
  v.scales[3] = 0.25f;
  EXPECT(VSPLAT_OK, vsplat_scene_update(scene, &arrays));
  EXPECT(VSPLAT_OK, vsplat_scene_get_gaussians(scene, &out));
  HOLD(memcmp(got.scales, v.scales, sizeof(float) * 3 * count) == 0);
  vsplat_scene_release(scene);
}

enum { side = 20, pixels = side * side };

static vsplat_camera make_camera(void) {
  vsplat_camera out = VSPLAT_CAMERA_INIT;
  out.width = out.height = side;
  out.fx = out.fy = 25;
  out.cx = out.cy = side / 2.0;
  return out;
}

/* A loss that weights every value of the picture. */
static vsplat_picture make_weights(float* weights) {
  vsplat_picture out = VSPLAT_PICTURE_INIT;
  int i;
  for (i = 0; i < 5 * pixels; ++i) weights[i] = 0.5f + 0.01f * (float)(i * 7919 % 101);
  out.capacity = pixels;
  out.colour = weights;
  out.alpha = weights + 3 * pixels;
  out.depth = weights + 4 * pixels;
  return out;
}

static double loss_of(vsplat_device device, vsplat_scene scene, const vsplat_camera* camera, const float* weights) {
  float drawn[5 * pixels];
  vsplat_picture picture = VSPLAT_PICTURE_INIT;
  double sum = 0;
  int i;
  picture.capacity = pixels;
  picture.colour = drawn;
  picture.alpha = drawn + 3 * pixels;
  picture.depth = drawn + 4 * pixels;
  EXPECT(VSPLAT_OK, vsplat_render(device, scene, camera, NULL, &picture));
  for (i = 0; i < 5 * pixels; ++i) sum += (double)weights[i] * (double)drawn[i];
  return sum;
}

static void refuses_bad_gradients(vsplat_device device) {
  values v = make_values(), by;
  vsplat_scene scene = make_scene(&v);
  vsplat_camera camera = make_camera();
  float weights[5 * pixels];
  vsplat_picture gradient = make_weights(weights);
  vsplat_gaussians arrays = arrays_of(&by);
  double pose[6];
  gradient.capacity = pixels - 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render_backward(device, scene, &camera, NULL, &gradient, &arrays, pose));
  gradient.capacity = pixels;
  arrays.capacity = count - 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render_backward(device, scene, &camera, NULL, &gradient, &arrays, pose));
  arrays.capacity = count;
  weights[3 * pixels + 5] = NAN;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_render_backward(device, scene, &camera, NULL, &gradient, &arrays, pose));
  HOLD(strstr(vsplat_last_error(), "gradient.alpha") && strstr(vsplat_last_error(), "index 5"));
  weights[3 * pixels + 5] = 0;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render_backward(device, scene, &camera, NULL, &gradient, NULL, NULL));
  EXPECT(VSPLAT_OK, vsplat_render_backward(device, scene, &camera, NULL, &gradient, NULL, pose));
  vsplat_scene_release(scene);
}

/* Central difference by one value. */
static double difference(vsplat_device device, vsplat_scene scene, values* v, float* value, float step,
                         const float* weights) {
  const vsplat_camera camera = make_camera();
  const vsplat_gaussians arrays = arrays_of(v);
  const float base = *value;
  double high, low;
  *value = base + step;
  EXPECT(VSPLAT_OK, vsplat_scene_update(scene, &arrays));
  high = loss_of(device, scene, &camera, weights);
  *value = base - step;
  EXPECT(VSPLAT_OK, vsplat_scene_update(scene, &arrays));
  low = loss_of(device, scene, &camera, weights);
  *value = base;
  EXPECT(VSPLAT_OK, vsplat_scene_update(scene, &arrays));
  return (high - low) / (2 * (double)step);
}

/* Within a thousandth, which is the accuracy of differences of float pictures. */
static void near_at(int line, double got, double want) {
  hold_at(line, fabs(want) > 1e-3 && fabs(got - want) <= 1e-3 * fabs(want), "a derivative");
  if (!(fabs(got - want) <= 1e-3 * fabs(want))) printf("%g, %g expected\n", got, want);
}
#define NEAR(got, want) near_at(__LINE__, got, want)

static void matches_differences(vsplat_device device) {
  values v = make_values(), by, again;
  vsplat_scene scene = make_scene(&v);
  vsplat_camera camera = make_camera();
  float weights[5 * pixels];
  vsplat_picture gradient = make_weights(weights);
  vsplat_gaussians arrays = arrays_of(&by);
  double pose[6], pose_again[6], high, low;
  memset(&by, 0x7f, sizeof by);
  EXPECT(VSPLAT_OK, vsplat_render_backward(device, scene, &camera, NULL, &gradient, &arrays, pose));
  NEAR((double)by.means[1], difference(device, scene, &v, &v.means[1], 0.01f, weights));
  NEAR((double)by.means[5], difference(device, scene, &v, &v.means[5], 0.01f, weights));
  NEAR((double)by.scales[0], difference(device, scene, &v, &v.scales[0], 0.005f, weights));
  NEAR((double)by.rotations[3], difference(device, scene, &v, &v.rotations[3], 0.02f, weights));
  NEAR((double)by.opacities[1], difference(device, scene, &v, &v.opacities[1], 0.02f, weights));
  NEAR((double)by.sh[7], difference(device, scene, &v, &v.sh[7], 0.02f, weights));
  camera.w2c[11] = 0.01;
  high = loss_of(device, scene, &camera, weights);
  camera.w2c[11] = -0.01;
  low = loss_of(device, scene, &camera, weights);
  camera.w2c[11] = 0;
  NEAR(pose[5], (high - low) / 0.02);
  /* The third Gaussian, for which there was only capacity, stays unchanged. */
  memset(&again, 0x7f, sizeof again);
  HOLD(memcmp(&by.means[6], &again.means[6], 3 * sizeof(float)) == 0);
  again = by;
  arrays = arrays_of(&again);
  EXPECT(VSPLAT_OK, vsplat_render_backward(device, scene, &camera, NULL, &gradient, &arrays, pose_again));
  HOLD(memcmp(&by, &again, sizeof by) == 0 && memcmp(pose, pose_again, sizeof pose) == 0);
  vsplat_scene_release(scene);
}

/* The library stores two scales of each; the caller's arrays have three. */
static void matches_differences_of_surfels(vsplat_device device) {
  values v = make_values(), by;
  vsplat_scene scene = NULL;
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  vsplat_camera camera = make_camera();
  float weights[5 * pixels];
  vsplat_picture gradient = make_weights(weights);
  vsplat_gaussians arrays = arrays_of(&v), out = arrays_of(&by);
  int i;
  for (i = 0; i < 3 * count; ++i) v.scales[i] = i % 3 == 2 ? 0 : 2 * v.scales[i]; /* slanted surfels cover less */
  info.count = count;
  info.sh_degree = 1;
  info.surfels = 1;
  EXPECT(VSPLAT_OK, vsplat_scene_create(&info, &arrays, &scene));
  memset(&by, 0x7f, sizeof by);
  EXPECT(VSPLAT_OK, vsplat_render_backward(device, scene, &camera, NULL, &gradient, &out, NULL));
  NEAR((double)by.scales[0], difference(device, scene, &v, &v.scales[0], 0.005f, weights));
  NEAR((double)by.scales[4], difference(device, scene, &v, &v.scales[4], 0.005f, weights));
  NEAR((double)by.opacities[1], difference(device, scene, &v, &v.opacities[1], 0.02f, weights));
  NEAR((double)by.sh[7], difference(device, scene, &v, &v.sh[7], 0.02f, weights));
  HOLD(by.scales[2] == 0 && by.scales[5] == 0);
  vsplat_scene_release(scene);
}

/* A scene far from the origin, with its camera: equal picture and derivatives up to rounding. */
static void is_as_good_far_away(vsplat_device device) {
  values v = make_values(), by, far_by;
  vsplat_scene scene = make_scene(&v), far_scene = NULL;
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT, got = VSPLAT_SCENE_INFO_INIT;
  vsplat_camera camera = make_camera(), far_camera = make_camera();
  float weights[5 * pixels];
  vsplat_picture gradient = make_weights(weights);
  vsplat_gaussians arrays = arrays_of(&v), out = arrays_of(&by), far_out = arrays_of(&far_by);
  double pose[6], far_pose[6];
  size_t i;
  EXPECT(VSPLAT_OK, vsplat_scene_get_info(scene, &info));
  HOLD(info.offset[0] == 0 && info.offset[1] == 0 && info.offset[2] == 0);
  info.offset[1] = INFINITY;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_create(&info, &arrays, &far_scene));
  HOLD(strstr(vsplat_last_error(), "info.offset[1]") != NULL);
  info.offset[0] = 3e7, info.offset[1] = -1e7, info.offset[2] = 2e7 + 0.3;
  EXPECT(VSPLAT_OK, vsplat_scene_create(&info, &arrays, &far_scene));
  EXPECT(VSPLAT_OK, vsplat_scene_get_info(far_scene, &got));
  HOLD(memcmp(got.offset, info.offset, sizeof got.offset) == 0);
  for (i = 0; i < 3; ++i) far_camera.w2c[4 * i + 3] -= info.offset[i]; /* it looks along z */
  HOLD(fabs(loss_of(device, scene, &camera, weights) / loss_of(device, far_scene, &far_camera, weights) - 1) < 1e-6);
  EXPECT(VSPLAT_OK, vsplat_render_backward(device, scene, &camera, NULL, &gradient, &out, pose));
  EXPECT(VSPLAT_OK, vsplat_render_backward(device, far_scene, &far_camera, NULL, &gradient, &far_out, far_pose));
  NEAR((double)far_by.means[1], (double)by.means[1]);
  NEAR(far_pose[5], pose[5]);
  vsplat_scene_release(far_scene);
  vsplat_scene_release(scene);
}

int main(void) {
  vsplat_device device = NULL;
  refuses_bad_values();
  update_replaces_what_is_given();
  surfels_are_flat();
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &device));
  if (device) {
    refuses_bad_gradients(device);
    matches_differences(device);
    matches_differences_of_surfels(device);
    is_as_good_far_away(device);
  }
  vsplat_device_release(device);
  if (failures) printf("%d checks do not hold\n", failures);
  return failures != 0;
}
