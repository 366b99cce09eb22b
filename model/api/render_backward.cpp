// Gradients of a loss on a picture of a scene.
#include "model/render/render_backward.h"

#include <algorithm>
#include <cmath>

#include "model/api/cameras.h"
#include "model/api/drawing.h"
#include "model/base/scene_edit.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

// Uploads a caller's derivatives by one plane of the picture, of `shape`; an empty tensor if null.
Tensor upload_gradient(Context& ctx, const float* values, const Shape& shape, const char* name) {
  if (!values) return {};
  long count = 1;
  for (const long n : shape) count *= n;
  const float* bad = std::find_if(values, values + count, [](float v) { return !std::isfinite(v); });
  if (bad != values + count) fail(Status::input, "gradient.{}: {} at index {}", name, *bad, bad - values);
  return ctx.upload(shape, values, Type::f32, "gradient of the picture");
}

}  // namespace

vsplat_status vsplat_render_backward(vsplat_device device, vsplat_scene scene, const vsplat_camera* camera,
                                     const vsplat_render_options* options, const vsplat_picture* gradient,
                                     const vsplat_gaussians* arrays, double* out_pose) {
  return guarded([&] {
    const DeviceUse use(device);
    need(scene, "scene");
    need(camera, "camera");
    need(gradient, "gradient");
    const std::shared_ptr<const Scene> seen = scene->now();
    const Camera view = in_frame(*seen, camera_of(*camera, "camera"));
    const vsplat_render_options o = taken(options, VSPLAT_RENDER_OPTIONS_INIT, "options");
    const vsplat_picture p = taken(gradient, VSPLAT_PICTURE_INIT, "gradient");
    const vsplat_gaussians a = taken(arrays, VSPLAT_GAUSSIANS_INIT, "arrays");
    const Gaussians& g = seen->gaussians;
    const uint64_t pixels = static_cast<uint64_t>(view.width) * static_cast<uint64_t>(view.height);
    if (p.capacity < pixels)
      fail(Status::usage, "gradient.capacity is {} pixels: the camera's picture has {}", p.capacity, pixels);
    if (arrays && a.capacity < g.count)
      fail(Status::usage, "arrays.capacity is {}: the scene has {} Gaussians", a.capacity, g.count);
    Outputs outputs;
    add_to(outputs, a, g.count, g.sh_degree, "arrays");
    outputs.add(out_pose, 6 * sizeof *out_pose, "out_pose");
    if (!a.means && !a.scales && !a.rotations && !a.opacities && !a.sh && !out_pose)
      fail(Status::usage, "arrays and out_pose are null: there is no gradient to compute");
    outputs.refuse_shared();
    const RenderOptions how = derived_as(o, *seen);
    if (o.progress && !o.progress(o.user, "splat", 0.0)) fail(Status::cancelled, "stopped before drawing");
    Context& ctx = device->context;
    const GaussianChunks& placed = on_device(device, seen, static_cast<double>(pixels));
    const long h = view.height, w = view.width;
    const PictureGradient by_picture{upload_gradient(ctx, p.colour, {h, w, 3}, "colour"),
                                     upload_gradient(ctx, p.alpha, {h, w}, "alpha"),
                                     upload_gradient(ctx, p.depth, {h, w}, "depth")};
    const SceneGradient out = zero_gradient(ctx, placed);
    std::array<double, 6> pose{};
    render_backward(ctx, placed, view, how, by_picture, out, out_pose ? &pose : nullptr);
    Gaussians got = download(ctx, out, g.drawn_degree());
    ctx.finish();
    set_degree(got, g.sh_degree);
    copy_out(got, a);
    if (out_pose) std::copy(pose.begin(), pose.end(), out_pose);
  });
}
