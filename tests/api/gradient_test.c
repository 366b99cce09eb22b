/* Scenes made of a caller's arrays, changed, drawn and differentiated, in plain C. Prints every check that does not
   hold; exits 1 if any did. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <vsplat/vsplat.h>

static int failures = 0;

static void expect_at(int line, vsplat_status got, vsplat_status wanted, const char* call) {
  if (got == wanted && (got == VSPLAT_OK || strlen(vsplat_last_error()) > 0)) return;
  ++failures;
  printf("line %d: %s: %s, %s expected (%s)\n", line, call, vsplat_status_name(got), vsplat_status_name(wanted),
         vsplat_last_error());
}
#define EXPECT(status, call) expect_at(__LINE__, call, status, #call)

static void hold_at(int line, int good, const char* what) {
  if (good) return;
  ++failures;
  printf("line %d: %s does not hold\n", line, what);
}
#define HOLD(what) hold_at(__LINE__, (what) != 0, #what)

enum { count = 2, coefficients = 4 };

/* What a caller has of two Gaussians before the camera, with room for a third. */
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
    v.scales[3 * i] = 0.2f, v.scales[3 * i + 1] = 0.1f, v.scales[3 * i + 2] = 0.15f;
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

/* What vsplat_scene_create refuses, with the words that say why. */
static void refuses_bad_values(void) {
  values v = make_values();
  vsplat_scene scene = NULL;
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  vsplat_gaussians arrays = arrays_of(&v);
  info.count = count;
  info.sh_degree = 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_create(NULL, &arrays, &scene));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_create(&info, NULL, &scene));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_create(&info, &arrays, NULL));
  info.sh_degree = 4;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_create(&info, &arrays, &scene));
  info.sh_degree = 1;
  info.near_plane = -1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_create(&info, &arrays, &scene));
  info.near_plane = 0;
  info.count = 4;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_create(&info, &arrays, &scene)); /* room for 3 */
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
  v.sh[24] = v.sh[23]; /* of the third, which is not meant */
  v.sh[23] = 0;
  info.has_mirror = 1;
  info.mirror[2] = NAN;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_create(&info, &arrays, &scene));
  HOLD(!scene);
  info.mirror[2] = 3;
  EXPECT(VSPLAT_OK, vsplat_scene_create(&info, &arrays, &scene));
  EXPECT(VSPLAT_OK, vsplat_scene_get_info(scene, &info));
  HOLD(info.count == count && info.has_mirror && info.mirror[2] == 3 && fabs(info.near_plane - 0.2) < 1e-6);
  vsplat_scene_release(scene);
  info.count = 0;
  memset(&arrays, 0, sizeof arrays);
  arrays.size = sizeof arrays;
  scene = NULL;
  EXPECT(VSPLAT_OK, vsplat_scene_create(&info, &arrays, &scene)); /* nothing at all is a scene, too */
  vsplat_scene_release(scene);
}

static void update_replaces_what_is_given(void) {
  values v = make_values(), got;
  vsplat_scene scene = make_scene(&v);
  vsplat_gaussians some = VSPLAT_GAUSSIANS_INIT, all = arrays_of(&got);
  float opacities[count] = {0.25f, 0.5f};
  some.capacity = count;
  some.opacities = opacities;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_update(NULL, &some));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_update(scene, NULL));
  EXPECT(VSPLAT_OK, vsplat_scene_update(scene, &some));
  EXPECT(VSPLAT_OK, vsplat_scene_get_gaussians(scene, &all));
  HOLD(memcmp(got.opacities, opacities, sizeof opacities) == 0);
  HOLD(memcmp(got.means, v.means, sizeof(float) * 3 * count) == 0);
  HOLD(memcmp(got.rotations, v.rotations, sizeof(float) * 4 * count) == 0); /* not made of length 1 */
  HOLD(memcmp(got.sh, v.sh, sizeof(float) * 3 * coefficients * count) == 0);
  some.capacity = count - 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_update(scene, &some));
  some.capacity = count;
  opacities[1] = NAN;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_scene_update(scene, &some));
  EXPECT(VSPLAT_OK, vsplat_scene_get_gaussians(scene, &all));
  HOLD(got.opacities[0] == 0.25f && got.opacities[1] == 0.5f); /* as it was */
  vsplat_scene_release(scene);
}

int main(void) {
  refuses_bad_values();
  update_replaces_what_is_given();
  if (failures) printf("%d checks do not hold\n", failures);
  return failures != 0;
}
