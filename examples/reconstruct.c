/* From a folder of posed photographs to a 3D Gaussian splat and a picture of it, using only the public C interface.

     reconstruct VIEWS SCENE.ply PICTURE.png [MODEL.safetensors] */
#include <stdio.h>
#include <stdlib.h>
#include <vsplat/vsplat.h>

static void check(vsplat_status status, const char* what) {
  if (status == VSPLAT_OK) return;
  fprintf(stderr, "%s: %s error: %s\n", what, vsplat_status_name(status), vsplat_last_error());
  exit(1);
}

static int32_t show_progress(void* user, const char* stage, double done) {
  (void)user;
  fprintf(stderr, "%3.0f %%  %s\n", 100.0 * done, stage);
  return 1; /* 0 would stop it */
}

/* Draws the scene from the first camera of a circle about the object. */
static void draw(vsplat_device device, vsplat_scene scene, vsplat_input input, const char* path) {
  vsplat_orbit_options circle = VSPLAT_ORBIT_OPTIONS_INIT;
  vsplat_cameras cameras = NULL;
  vsplat_camera camera = VSPLAT_CAMERA_INIT;
  vsplat_picture picture = VSPLAT_PICTURE_INIT;
  circle.count = 8;
  check(vsplat_cameras_orbit_input(input, &circle, &cameras), "orbit");
  check(vsplat_cameras_get(cameras, 0, &camera), "camera");
  picture.capacity = (uint64_t)camera.width * (uint64_t)camera.height;
  picture.colour = malloc(picture.capacity * 3 * sizeof(float));
  if (!picture.colour) check(VSPLAT_ERROR_MEMORY, "picture");
  check(vsplat_render(device, scene, &camera, NULL, &picture), "render");
  check(vsplat_picture_save(&picture, camera.width, camera.height, VSPLAT_PICTURE_PNG, path), "picture");
  free(picture.colour);
  vsplat_cameras_release(cameras);
}

/* Copies the Gaussians out, for programs that process them further. */
static void look_at_gaussians(vsplat_scene scene) {
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
  double sum = 0;
  uint64_t i;
  check(vsplat_scene_get_info(scene, &info), "scene");
  arrays.capacity = info.count;
  arrays.opacities = malloc((info.count ? info.count : 1) * sizeof(float));
  if (!arrays.opacities) check(VSPLAT_ERROR_MEMORY, "gaussians");
  check(vsplat_scene_get_gaussians(scene, &arrays), "gaussians");
  for (i = 0; i < info.count; ++i) sum += (double)arrays.opacities[i];
  printf("%llu Gaussians, mean opacity %.3f\n", (unsigned long long)info.count,
         info.count ? sum / (double)info.count : 0.0);
  free(arrays.opacities);
}

int main(int argc, char** argv) {
  vsplat_device device = NULL;
  vsplat_model model = NULL;
  vsplat_views views = NULL;
  vsplat_input input = NULL;
  vsplat_scene scene = NULL;
  vsplat_device_info info = VSPLAT_DEVICE_INFO_INIT;
  vsplat_reconstruct_options options = VSPLAT_RECONSTRUCT_OPTIONS_INIT;
  if (argc != 4 && argc != 5) {
    fprintf(stderr, "usage: %s VIEWS SCENE.ply PICTURE.png [MODEL.safetensors]\n", argv[0]);
    return 2;
  }
  check(vsplat_device_open(NULL, &device), "device");
  check(vsplat_device_get_info(device, &info), "device");
  fprintf(stderr, "vsplat %s on %s\n", vsplat_version_string(), info.name);
  check(vsplat_model_load(argc == 5 ? argv[4] : NULL, &model), "model"); /* NULL: the built-in model */
  check(vsplat_views_load(argv[1], NULL, &views), "views");
  check(vsplat_input_prepare(model, views, NULL, &input), "input");
  options.progress = show_progress;
  check(vsplat_reconstruct(device, model, input, &options, &scene), "reconstruct");
  check(vsplat_scene_save(scene, argv[2]), "scene");
  look_at_gaussians(scene);
  draw(device, scene, input, argv[3]);
  vsplat_scene_release(scene);
  vsplat_input_release(input);
  vsplat_views_release(views);
  vsplat_model_release(model);
  vsplat_device_release(device);
  return 0;
}
