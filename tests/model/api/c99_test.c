/* Compiles the public header as plain C and uses it: values that are refused, with the exact status of each call,
   and a reconstruction from pictures in memory. Prints every check that fails; exits 1 if any did. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <vsplat/vsplat.h>

#include "checks.h"

static void bad_values(vsplat_device device) {
  vsplat_device other = NULL;
  vsplat_device_options options = VSPLAT_DEVICE_OPTIONS_INIT;
  vsplat_device_info info = VSPLAT_DEVICE_INFO_INIT;
  vsplat_model model = NULL;
  vsplat_model_options model_options = VSPLAT_MODEL_OPTIONS_INIT;
  vsplat_scene scene = NULL;
  vsplat_plan plan = VSPLAT_PLAN_INIT;
  vsplat_hash_state hash;
  char* text = NULL;
  const char* unknown_field[] = {"depth=7"};

  options.device = "no such device";
  EXPECT(VSPLAT_ERROR_DEVICE, vsplat_device_open(&options, &other));
  HOLD(strstr(vsplat_last_error(), "no such device") != NULL);
  options.device = NULL;
  options.kernels = (vsplat_kernels)7;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_device_open(&options, &other));
  options.kernels = VSPLAT_KERNELS_AUTO;
  options.max_memory_gib = NAN;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_device_open(&options, &other));
  options.size = 0;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_device_open(&options, &other));
  HOLD(strstr(vsplat_last_error(), "_INIT") != NULL);
  EXPECT(VSPLAT_ERROR_DEVICE, vsplat_device_describe(100000, &info));
  info.size = 0;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_device_get_info(device, &info));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_device_profile_text(device, (vsplat_profile_format)9, &text));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_profile_begin(-1));

  model_options.config = "huge";
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_model_init(&model_options, &model));
  model_options.config = "micro";
  model_options.num_fields = 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_model_init(&model_options, &model));
  model_options.fields = unknown_field;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_model_init(&model_options, &model));
  EXPECT(VSPLAT_ERROR_FILE, vsplat_model_load("/no/such/file", &model));
  EXPECT(VSPLAT_ERROR_FILE, vsplat_model_verify("/no/such/file", &hash));
  EXPECT(VSPLAT_ERROR_FILE, vsplat_scene_load("/no/such/file", &scene));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_plan_render(device, 1, 9, 8, 8, &plan));
  HOLD(!other && !model && !scene && !text);
}

/* More Gaussians take more memory, whatever the limit; if drawing is impossible, the error says how much it would
   take. */
/* Sizes per Gaussian: 56 bytes for the scene and 180 for drawing. */
static void plans_of_drawing(vsplat_device device) {
  const uint64_t bytes_each = 56 + 180, fitting[] = {1, 1000, 100000, 1000000}, beyond = 1300000000;
  vsplat_plan plan = VSPLAT_PLAN_INIT;
  uint64_t before = 0;
  size_t i;
  for (i = 0; i < sizeof fitting / sizeof *fitting; ++i) {
    EXPECT(VSPLAT_OK, vsplat_plan_render(device, fitting[i], 3, 1280, 720, &plan));
    HOLD(plan.fits && plan.peak > before && plan.peak >= fitting[i] * bytes_each / 2);
    before = plan.peak;
  }
  EXPECT(VSPLAT_OK, vsplat_plan_render(device, beyond, 3, 1280, 720, &plan));
  HOLD(!plan.fits && plan.peak > beyond * bytes_each);
}

/* A caller built with a shorter struct than the library's gets the fields that it declares, and no byte more. */
static void short_structs(vsplat_device device) {
  vsplat_device_info whole = VSPLAT_DEVICE_INFO_INIT, part = VSPLAT_DEVICE_INFO_INIT;
  const size_t room = offsetof(vsplat_device_info, vendor);
  size_t i;
  memset(&part, 0x5a, sizeof part);
  part.size = room;
  EXPECT(VSPLAT_OK, vsplat_device_get_info(device, &whole));
  EXPECT(VSPLAT_OK, vsplat_device_get_info(device, &part));
  HOLD(part.size == room && strcmp(part.name, whole.name) == 0);
  for (i = room; i < sizeof part; ++i)
    if (((const unsigned char*)&part)[i] != 0x5a) break;
  HOLD(i == sizeof part);
}

enum { side = 16, num_views = 2 };

static vsplat_camera camera_at(double z_sign) {
  vsplat_camera out = VSPLAT_CAMERA_INIT;
  out.width = out.height = side;
  out.fx = out.fy = 20;
  out.cx = out.cy = side / 2.0;
  out.w2c[0] = out.w2c[10] = z_sign; /* from the front, and from behind: half a turn about y */
  out.w2c[11] = 2;
  return out;
}

static vsplat_views make_views(float* pixels) {
  vsplat_view all[num_views] = {VSPLAT_VIEW_INIT, VSPLAT_VIEW_INIT};
  vsplat_views views = NULL;
  int i;
  for (i = 0; i < side * side * 3; ++i) pixels[i] = (float)(i * 7919 % 101) / 101.0f;
  for (i = 0; i < num_views; ++i) {
    all[i].pixels = pixels;
    all[i].camera = camera_at(i ? -1 : 1);
  }
  all[1].channels = 5;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_views_create(all, num_views, &views));
  all[1].channels = 3;
  all[1].pixels = NULL;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_views_create(all, num_views, &views));
  all[1].pixels = pixels;
  all[1].camera.fx = NAN;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_views_create(all, num_views, &views));
  all[1].camera = camera_at(-1);
  all[1].camera.w2c[0] = 0;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_views_create(all, num_views, &views));
  all[1].camera = camera_at(-1);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_views_create(all, 0, &views));
  for (i = 0; i < 4; ++i) { /* a view's pixel 3, 1 of channel 2 */
    static const char* const written[] = {"is NaN", "is 255", "is 1e+30", "is -1"};
    const float wrong[] = {NAN, 255.0f, 1e30f, -1.0f}, before = pixels[(side + 3) * 3 + 2];
    pixels[(side + 3) * 3 + 2] = wrong[i];
    EXPECT(VSPLAT_ERROR_INPUT, vsplat_views_create(all, num_views, &views));
    HOLD(strstr(vsplat_last_error(), "views[0].pixels: pixel 3, 1 of channel 2"));
    HOLD(strstr(vsplat_last_error(), written[i]));
    pixels[(side + 3) * 3 + 2] = before;
  }
  HOLD(!views);
  EXPECT(VSPLAT_OK, vsplat_views_create(all, num_views, &views));
  return views;
}

static int32_t stop(void* user, const char* stage, double done) {
  (void)done;
  *(int*)user += stage && *stage;
  return 0;
}

static void use_scene(vsplat_device device, vsplat_scene scene, const int32_t* voxels, size_t selected) {
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
  vsplat_camera camera = camera_at(1);
  vsplat_picture picture = VSPLAT_PICTURE_INIT;
  float colour[side * side * 3], alpha[side * side];
  vsplat_orbit_options orbit = VSPLAT_ORBIT_OPTIONS_INIT;
  vsplat_cameras cameras = NULL;
  size_t count = 0, i;
  EXPECT(VSPLAT_OK, vsplat_scene_get_info(scene, &info));
  HOLD(info.count == selected * 3 && info.sh_degree == 1); /* micro: two fine ones and a skeletal one each */
  HOLD(fabs(info.near_plane - 0.2) < 1e-6);
  arrays.capacity = info.count - 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_get_gaussians(scene, &arrays));
  arrays.capacity = info.count;
  arrays.means = malloc(info.count * 3 * sizeof(float));
  EXPECT(VSPLAT_OK, vsplat_scene_get_gaussians(scene, &arrays));
  for (i = 0; i < info.count * 3 && fabsf(arrays.means[i]) < 1; ++i) continue;
  HOLD(i == info.count * 3);
  free(arrays.means);
  EXPECT(VSPLAT_OK, vsplat_scene_get_selection(scene, NULL, 0, &count));
  HOLD(count == selected && voxels[0] == 3);

  picture.capacity = side * side - 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_render(device, scene, &camera, NULL, &picture));
  picture.capacity = side * side;
  picture.colour = colour;
  picture.alpha = alpha;
  camera.width = 0;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_render(device, scene, &camera, NULL, &picture));
  camera.width = side;
  for (i = 0; i < side * side; ++i) alpha[i] = NAN;
  EXPECT(VSPLAT_OK, vsplat_render(device, scene, &camera, NULL, &picture));
  for (i = 0; i < side * side && alpha[i] >= 0 && alpha[i] <= 1; ++i) continue;
  HOLD(i == side * side);
  {
    const vsplat_camera cameras2[2] = {camera, camera};
    vsplat_render_options exact = VSPLAT_RENDER_OPTIONS_INIT;
    vsplat_picture pictures2[2] = {VSPLAT_PICTURE_INIT, VSPLAT_PICTURE_INIT};
    float* again = malloc((size_t)side * side * sizeof(float));
    exact.exact_tiles = 1;
    pictures2[0].capacity = side * side;
    EXPECT(VSPLAT_ERROR_USAGE,
           vsplat_render_views(device, scene, cameras2, 2, NULL, pictures2)); /* the 2nd buffer is too small */
    pictures2[1].capacity = side * side;
    pictures2[1].alpha = again;
    EXPECT(VSPLAT_OK, vsplat_render_views(device, scene, cameras2, 2, &exact, pictures2));
    HOLD(memcmp(again, alpha, (size_t)side * side * sizeof(float)) == 0);
    EXPECT(VSPLAT_OK, vsplat_render_views(device, scene, NULL, 0, NULL, NULL));
    EXPECT(VSPLAT_ERROR_USAGE, vsplat_render_views(device, scene, NULL, 1, NULL, pictures2));
    /* A scene without a detail is drawn with one sample per pixel; more samples give another picture, which has no
       derivatives. */
    exact.supersample = 1;
    EXPECT(VSPLAT_OK, vsplat_render_views(device, scene, cameras2, 2, &exact, pictures2));
    HOLD(memcmp(again, alpha, (size_t)side * side * sizeof(float)) == 0);
    exact.supersample = 2;
    EXPECT(VSPLAT_OK, vsplat_render_views(device, scene, cameras2, 2, &exact, pictures2));
    HOLD(memcmp(again, alpha, (size_t)side * side * sizeof(float)) != 0);
    EXPECT(VSPLAT_ERROR_USAGE, vsplat_render_backward(device, scene, &camera, &exact, &pictures2[1], NULL, NULL));
    exact.supersample = 9;
    EXPECT(VSPLAT_ERROR_USAGE, vsplat_render_views(device, scene, cameras2, 2, &exact, pictures2));
    free(again);
  }
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_picture_save(&picture, side, side + 1, VSPLAT_PICTURE_PNG, "x.png"));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_picture_save(&picture, side, side, VSPLAT_PICTURE_EXR, "x.exr")); /* no depth */

  orbit.count = 0;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_cameras_orbit_scene(scene, &orbit, &cameras));
  orbit.count = 3;
  EXPECT(VSPLAT_OK, vsplat_cameras_orbit_scene(scene, &orbit, &cameras));
  EXPECT(VSPLAT_OK, vsplat_cameras_count(cameras, &count));
  HOLD(count == 3);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_cameras_get(cameras, 3, &camera));
  vsplat_cameras_release(cameras);
}

static void checked_model(vsplat_device device, vsplat_model model) {
  vsplat_check_options options = VSPLAT_CHECK_OPTIONS_INIT;
  char* text = NULL;
  int calls = 0;
  options.progress = stop;
  options.user = &calls;
  EXPECT(VSPLAT_ERROR_CANCELLED, vsplat_model_check(device, model, &options, &text));
  HOLD(calls == 1 && !text);
  EXPECT(VSPLAT_OK, vsplat_model_check(device, model, NULL, &text));
  HOLD(text && strstr(text, "\"psnr_nearest\"") != NULL);
  vsplat_text_free(text);
}

static void main_job(vsplat_device device) {
  static float pixels[side * side * 3], out[side * side * 3];
  const int32_t voxels[] = {3, 21, 40};
  const char* no_such_view[] = {"nobody"};
  vsplat_model_options model_options = VSPLAT_MODEL_OPTIONS_INIT;
  vsplat_model model = NULL;
  vsplat_model_info model_info = VSPLAT_MODEL_INFO_INIT;
  vsplat_views views = make_views(pixels);
  vsplat_input input = NULL;
  vsplat_input_options input_options = VSPLAT_INPUT_OPTIONS_INIT;
  vsplat_input_info input_info = VSPLAT_INPUT_INFO_INIT;
  vsplat_reconstruct_options options = VSPLAT_RECONSTRUCT_OPTIONS_INIT;
  vsplat_scene scene = NULL;
  vsplat_plan plan = VSPLAT_PLAN_INIT;
  char* text = NULL;
  int calls = 0;

  model_options.config = "micro";
  model_options.seed = 5;
  EXPECT(VSPLAT_OK, vsplat_model_init(&model_options, &model));
  EXPECT(VSPLAT_OK, vsplat_model_get_info(model, &model_info));
  HOLD(model_info.image == side && model_info.views == 2 && model_info.max_views == 16 && model_info.parameters > 0);
  HOLD(model_info.max_gaussians == 4 * 4 * 4 * 3);

  input_options.names = no_such_view;
  input_options.num_names = 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_input_prepare(model, views, &input_options, &input));
  input_options.num_names = 0;
  input_options.has_center = 1;
  input_options.center[2] = -3;
  EXPECT(VSPLAT_ERROR_INPUT, vsplat_input_prepare(model, views, &input_options, &input)); /* behind the first camera */
  input_options.center[2] = NAN;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_input_prepare(model, views, &input_options, &input));
  HOLD(!input);
  EXPECT(VSPLAT_OK, vsplat_input_prepare(model, views, NULL, &input));
  vsplat_views_release(views);
  EXPECT(VSPLAT_OK, vsplat_input_get_info(input, &input_info));
  HOLD(input_info.views == num_views && input_info.image == side && input_info.scale == 1);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_input_get_picture(input, 0, out, 5));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_input_get_picture(input, num_views, out, side * side * 3));
  EXPECT(VSPLAT_OK, vsplat_input_get_picture(input, 0, out, side * side * 3));
  HOLD(memcmp(out, pixels, sizeof out) == 0); /* the network's own size: bit for bit */

  EXPECT(VSPLAT_ERROR_USAGE, vsplat_plan_reconstruct(device, model, 17, 0.1, &plan));
  EXPECT(VSPLAT_OK, vsplat_plan_reconstruct(device, model, num_views, 0.1, &plan));
  HOLD(plan.fits && plan.peak > 0 && plan.num_stages > 0);

  options.progress = stop;
  options.user = &calls;
  EXPECT(VSPLAT_ERROR_CANCELLED, vsplat_reconstruct(device, model, input, &options, &scene));
  HOLD(calls == 1 && !scene);
  options.progress = NULL;
  options.voxels = voxels;
  options.num_voxels = 3;
  EXPECT(VSPLAT_OK, vsplat_profile_begin(0));
  EXPECT(VSPLAT_OK, vsplat_device_profile(device, 1));
  EXPECT(VSPLAT_OK, vsplat_device_profile_name(device, "model", "an earlier name"));
  EXPECT(VSPLAT_OK, vsplat_device_profile_name(device, "model", "micro"));
  EXPECT(VSPLAT_OK, vsplat_reconstruct(device, model, input, &options, &scene));
  EXPECT(VSPLAT_OK, vsplat_device_profile_text(device, VSPLAT_PROFILE_JSON, &text));
  HOLD(text && strstr(text, "\"wall_s\"") != NULL);
  HOLD(text && strstr(text, "\"model\": \"micro\"") != NULL && strstr(text, "an earlier name") == NULL);
  vsplat_text_free(text);
  checked_model(device, model);
  vsplat_model_release(model);
  vsplat_input_release(input);
  if (scene) use_scene(device, scene, voxels, 3);
  vsplat_scene_release(scene);
}

/* The number of views is set by the options, else by the model. */
static void view_counts(void) {
  static float pixels[side * side * 3];
  vsplat_model_options model_options = VSPLAT_MODEL_OPTIONS_INIT;
  vsplat_model model = NULL, one = NULL, passing = NULL;
  vsplat_model_info model_info = VSPLAT_MODEL_INFO_INIT;
  vsplat_views views = make_views(pixels);
  vsplat_input input = NULL;
  vsplat_input_options options = VSPLAT_INPUT_OPTIONS_INIT;
  vsplat_input_info info = VSPLAT_INPUT_INFO_INIT;
  const char* first[] = {"@0"};

  model_options.config = "micro";
  EXPECT(VSPLAT_OK, vsplat_model_init(&model_options, &model));
  EXPECT(VSPLAT_OK, vsplat_model_get_info(model, &model_info));
  HOLD(model_info.views == 2 && model_info.use_views == 2);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_model_with_use_views(model, 0, &one));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_model_with_use_views(model, 17, &one));
  HOLD(!one);
  EXPECT(VSPLAT_OK, vsplat_model_with_use_views(model, 1, &one));
  EXPECT(VSPLAT_OK, vsplat_model_get_info(one, &model_info));
  HOLD(model_info.views == 2 && model_info.use_views == 1);
  HOLD(model_info.passes == 1 && model_info.merge_cell == 0 && model_info.fit_epochs == 0);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_model_with_passes(one, 0, 1, 0, &passing));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_model_with_passes(one, 2, -1, 0, &passing));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_model_with_passes(one, 2, 1, 1001, &passing));
  HOLD(!passing);
  EXPECT(VSPLAT_OK, vsplat_model_with_passes(one, 2, 0.5, 7, &passing));
  EXPECT(VSPLAT_OK, vsplat_model_get_info(passing, &model_info));
  HOLD(model_info.use_views == 1 && model_info.passes == 2 && model_info.merge_cell == 0.5 &&
       model_info.fit_epochs == 7);
  vsplat_model_release(passing);
  EXPECT(VSPLAT_OK, vsplat_input_prepare(one, views, NULL, &input));
  EXPECT(VSPLAT_OK, vsplat_input_get_info(input, &info));
  HOLD(info.views == 1);
  vsplat_input_release(input);
  input = NULL;
  options.view_count = 2;
  EXPECT(VSPLAT_OK, vsplat_input_prepare(one, views, &options, &input));
  EXPECT(VSPLAT_OK, vsplat_input_get_info(input, &info));
  HOLD(info.views == 2);
  vsplat_input_release(input);
  input = NULL;
  options.view_count = 17;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_input_prepare(one, views, &options, &input));
  options.view_count = -1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_input_prepare(one, views, &options, &input));
  options.view_count = 2;
  options.names = first;
  options.num_names = 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_input_prepare(one, views, &options, &input));
  HOLD(!input);
  vsplat_views_release(views);
  vsplat_model_release(one);
  vsplat_model_release(model);
}

/* Three Gaussians as text; two of them cannot be drawn. */
static void damaged_scene(void) {
  const char* path = "c99_test_scene.ply"; /* in the build folder, where ctest runs this */
  vsplat_scene scene = NULL;
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  vsplat_scene_load_options options = VSPLAT_SCENE_LOAD_OPTIONS_INIT;
  FILE* file = fopen(path, "w");
  HOLD(file != NULL);
  if (!file) return;
  fputs(
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\nproperty float rot_0\n"
      "property float rot_1\nproperty float rot_2\nproperty float rot_3\nend_header\n"
      "0 0 0 0 0 0 0 0 0 0\n0 0 0 nan 0 0 1 0 0 0\n0 0 0 0 0 0 1 0 0 0\n",
      file);
  fclose(file);
  EXPECT(VSPLAT_ERROR_FORMAT, vsplat_scene_load(path, &scene));
  HOLD(strstr(vsplat_last_error(), "Gaussian 0, rot_0") != NULL && !scene);
  EXPECT(VSPLAT_ERROR_FORMAT, vsplat_scene_load_with(path, NULL, &scene));
  EXPECT(VSPLAT_ERROR_FORMAT, vsplat_scene_load_with(path, &options, &scene));
  options.skip_bad = 1;
  EXPECT(VSPLAT_OK, vsplat_scene_load_with(path, &options, &scene));
  EXPECT(VSPLAT_OK, vsplat_scene_get_info(scene, &info));
  HOLD(info.count == 1 && info.skipped_zero_rotation == 1 && info.skipped_not_finite == 1 &&
       info.skipped_huge_scale == 0);
  vsplat_scene_release(scene);
  options.size = 3;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_load_with(path, &options, &scene));
  remove(path);
}

/* Messages name options as in C, or as the program has said. */
static void option_names(void) {
  const char *fields[] = {"vsplat_device_options.device", "vsplat_nothing"}, *names[] = {"their device", "nothing"};
  vsplat_device_options options = VSPLAT_DEVICE_OPTIONS_INIT;
  vsplat_device device = NULL;
  options.device = "quantum";
  EXPECT(VSPLAT_ERROR_DEVICE, vsplat_device_open(&options, &device));
  HOLD(strstr(vsplat_last_error(), "(vsplat_device_options.device)") != NULL);
  EXPECT(VSPLAT_OK, vsplat_option_names_set(fields, names, 1));
  EXPECT(VSPLAT_ERROR_DEVICE, vsplat_device_open(&options, &device));
  HOLD(strstr(vsplat_last_error(), "(their device)") != NULL);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_option_names_set(fields, names, 2));
  HOLD(strstr(vsplat_last_error(), "fields[1] is vsplat_nothing") != NULL);
  HOLD(vsplat_device_open(&options, &device) && strstr(vsplat_last_error(), "(their device)")); /* as before */
  EXPECT(VSPLAT_OK, vsplat_option_names_set(NULL, NULL, 0));
  EXPECT(VSPLAT_ERROR_DEVICE, vsplat_device_open(&options, &device));
  HOLD(strstr(vsplat_last_error(), "(vsplat_device_options.device)") != NULL);
}

int main(void) {
  vsplat_device device = NULL;
  HOLD(vsplat_version() == VSPLAT_VERSION && strcmp(vsplat_version_string(), VSPLAT_VERSION_STRING) == 0);
  HOLD(strcmp(vsplat_status_name(VSPLAT_ERROR_MEMORY), "memory") == 0);
  HOLD(strcmp(vsplat_last_error(), "") == 0);
  damaged_scene();
  option_names();
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &device));
  if (device) {
    bad_values(device);
    short_structs(device);
    plans_of_drawing(device);
    main_job(device);
    view_counts();
    vsplat_device_retain(device);
    vsplat_device_release(device);
    vsplat_device_release(device);
  }
  if (failures) printf("%d checks do not hold\n", failures);
  return failures != 0;
}
