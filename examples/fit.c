/* Fits a handful of Gaussians to a picture by gradient descent, using only the public C interface.

       fit BEFORE.png AFTER.png

   The library draws the picture from other Gaussians, which the fit does not see, so a loss of 0 is possible. Prints
   the loss during the fit; exits with 3 if it does not fall to a hundredth. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <vsplat/vsplat.h>

enum { count = 24, side = 64, steps = 300, pixels = 3 * side * side };

/* A Gaussian's free parameters, unconstrained: position, logarithms of the scales, rotation, logit of the opacity, and
   the constant spherical harmonic. */
enum {
  means = 0,
  scales = 3 * count,
  rotations = 6 * count,
  opacities = 10 * count,
  sh = 11 * count,
  all = 14 * count
};

static void check(vsplat_status status, const char* what) {
  if (status == VSPLAT_OK) return;
  fprintf(stderr, "%s: %s error: %s\n", what, vsplat_status_name(status), vsplat_last_error());
  exit(1);
}

/* In [-1, 1), equal on every machine. */
static float random_float(uint32_t* state) {
  *state = *state * 1664525u + 1013904223u;
  return (float)(*state >> 8) / 8388608.0f - 1.0f;
}

static void random_parameters(float* p, uint32_t seed) {
  int k, i;
  for (k = 0; k < count; ++k) {
    for (i = 0; i < 3; ++i) p[means + 3 * k + i] = 0.8f * random_float(&seed);
    for (i = 0; i < 3; ++i) p[scales + 3 * k + i] = -1.6f + 0.4f * random_float(&seed);
    for (i = 0; i < 4; ++i) p[rotations + 4 * k + i] = random_float(&seed) + (i == 0 ? 1.5f : 0.0f);
    p[opacities + k] = random_float(&seed);
    for (i = 0; i < 3; ++i) p[sh + 3 * k + i] = 1.5f * random_float(&seed);
  }
}

/* Converts parameters to the library's values: scales and opacities themselves. */
static vsplat_gaussians to_gaussians(const float* p, float* v) {
  vsplat_gaussians out = VSPLAT_GAUSSIANS_INIT;
  int i;
  for (i = 0; i < all; ++i) v[i] = p[i];
  for (i = scales; i < rotations; ++i) v[i] = expf(p[i]);
  for (i = opacities; i < sh; ++i) v[i] = 1.0f / (1.0f + expf(-p[i]));
  out.capacity = count;
  out.means = v + means;
  out.scales = v + scales;
  out.rotations = v + rotations;
  out.opacities = v + opacities;
  out.sh = v + sh;
  return out;
}

/* Converts derivatives by those values, v, to derivatives by the parameters, in place. */
static void to_parameters(const float* v, float* gradient) {
  int i;
  for (i = scales; i < rotations; ++i) gradient[i] *= v[i];
  for (i = opacities; i < sh; ++i) gradient[i] *= v[i] * (1.0f - v[i]);
}

/* Adam (Kingma and Ba, 2015): step sizes adapt to the history of the gradients. */
static void adam(float* p, const float* gradient, float* first, float* second, int step, float rate) {
  const float a = 0.9f, b = 0.99f, n = (float)step;
  int i;
  for (i = 0; i < all; ++i) {
    first[i] = a * first[i] + (1 - a) * gradient[i];
    second[i] = b * second[i] + (1 - b) * gradient[i] * gradient[i];
    p[i] -= rate * first[i] / (1 - powf(a, n)) / (sqrtf(second[i] / (1 - powf(b, n))) + 1e-12f);
  }
}

/* The mean squared difference of two pictures, and its derivatives by the first one's values. */
static double loss_of(const float* drawn, const float* wanted, float* gradient) {
  double sum = 0;
  int i;
  for (i = 0; i < pixels; ++i) {
    const float d = drawn[i] - wanted[i];
    sum += (double)(d * d);
    gradient[i] = 2 * d / pixels;
  }
  return sum / pixels;
}

static vsplat_picture picture_of(float* colour) {
  vsplat_picture out = VSPLAT_PICTURE_INIT;
  out.capacity = side * side;
  out.colour = colour;
  return out;
}

int main(int argc, char** argv) {
  static float wanted[pixels], drawn[pixels], by_picture[pixels];
  static float p[all], v[all], by_value[all], first[all], second[all];
  const vsplat_picture target = picture_of(wanted), picture = picture_of(drawn), gradient = picture_of(by_picture);
  vsplat_device device = NULL;
  vsplat_scene scene = NULL;
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  vsplat_camera camera = VSPLAT_CAMERA_INIT;
  vsplat_gaussians values, by_values;
  double loss = 0, start = 0;
  int step;
  if (argc != 3) {
    fprintf(stderr, "usage: %s BEFORE.png AFTER.png\n", argv[0]);
    return 2;
  }
  check(vsplat_device_open(NULL, &device), "device");
  camera.width = camera.height = side;
  camera.fx = camera.fy = side;
  camera.cx = camera.cy = side / 2.0;
  camera.w2c[11] = 2.5; /* so that it looks at the origin */
  info.count = count;

  random_parameters(p, 1);
  values = to_gaussians(p, v);
  check(vsplat_scene_create(&info, &values, &scene), "scene");
  check(vsplat_render(device, scene, &camera, NULL, &target), "target");

  random_parameters(p, 2);
  by_values = values;
  by_values.means = by_value + means;
  by_values.scales = by_value + scales;
  by_values.rotations = by_value + rotations;
  by_values.opacities = by_value + opacities;
  by_values.sh = by_value + sh;
  for (step = 0; step <= steps; ++step) {
    values = to_gaussians(p, v);
    check(vsplat_scene_update(scene, &values), "update");
    check(vsplat_render(device, scene, &camera, NULL, &picture), "render");
    loss = loss_of(drawn, wanted, by_picture);
    if (step % 25 == 0) printf("step %3d  loss %.6f\n", step, loss);
    if (step == 0) {
      start = loss;
      check(vsplat_picture_save(&picture, side, side, VSPLAT_PICTURE_PNG, argv[1]), "before");
    }
    if (step == steps) break;
    check(vsplat_render_backward(device, scene, &camera, NULL, &gradient, &by_values, NULL), "backward");
    to_parameters(v, by_value);
    adam(p, by_value, first, second, step + 1, 0.03f);
  }
  check(vsplat_picture_save(&picture, side, side, VSPLAT_PICTURE_PNG, argv[2]), "after");
  vsplat_scene_release(scene);
  vsplat_device_release(device);
  return loss <= start / 100 ? 0 : 3;
}
