// Makes a small model and a plan with only the installed library, which contains its kernels.
#include <cstdio>
#include <vsplat/vsplat.hpp>

int main() try {
  vsplat_model_options options = VSPLAT_MODEL_OPTIONS_INIT;
  options.config = "micro";
  const vsplat::Model model = vsplat::Model::init(options);
  const vsplat::Device device{VSPLAT_DEVICE_OPTIONS_INIT};

  const float white[16 * 16 * 3] = {};
  vsplat_view view = VSPLAT_VIEW_INIT;
  view.pixels = white;
  view.camera.width = view.camera.height = 16;
  view.camera.fx = view.camera.fy = 20;
  view.camera.cx = view.camera.cy = 8;
  view.camera.w2c[11] = 2;
  const vsplat::Input input(model, vsplat::Views::create({view}), VSPLAT_INPUT_OPTIONS_INIT);
  const vsplat::Scene scene = vsplat::reconstruct(device, model, input);
  const vsplat::Picture picture = vsplat::render(device, scene, view.camera);
  std::printf("%llu Gaussians, first pixel %.3f\n", static_cast<unsigned long long>(scene.info().count),
              static_cast<double>(picture.colour[0]));

  try {
    vsplat::Scene::load("/no/such/file");
  } catch (const vsplat::Error& e) {
    return e.status() == VSPLAT_ERROR_FILE ? 0 : 1;
  }
  return 1;
} catch (const vsplat::Error& e) {
  std::fprintf(stderr, "%s\n", e.what());
  return 1;
}
