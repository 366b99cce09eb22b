#include "model/ops/project.h"

#include <cmath>

#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kViewFloats = 32;

// A position as a float and what rounding took from it: differences of nearby positions far from the origin stay exact.
void put_split(float* out, const Eigen::Vector3d& p) {
  for (int i = 0; i < 3; ++i) {
    out[i] = static_cast<float>(p[i]);
    out[3 + i] = static_cast<float>(p[i] - out[i]);
  }
}

}  // namespace

Tensor upload_views(Context& ctx, const std::vector<Camera>& cameras, float near,
                    const std::optional<std::array<float, 3>>& mirror) {
  if (!(near >= 0) || !std::isfinite(near))
    fail(Status::usage, "near plane {}: a distance of at least 0 is needed", near);
  std::vector<float> data(cameras.size() * kViewFloats, 0.0f);
  for (std::size_t v = 0; v < cameras.size(); ++v) {
    const Camera& camera = cameras[v];
    if (camera.width < 1 || camera.height < 1)
      fail(Status::input, "camera {} ({}): a picture of {} x {} pixels cannot be drawn", v, camera.file, camera.width,
           camera.height);
    if (!camera.w2c.allFinite() || !(camera.fx > 0) || !(camera.fy > 0) || !std::isfinite(camera.cx) ||
        !std::isfinite(camera.cy))
      fail(Status::input, "camera {} ({}): its pose or intrinsics are not finite, or a focal length is not positive", v,
           camera.file);
    float* out = &data[v * kViewFloats];
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c) out[3 * r + c] = static_cast<float>(camera.w2c(r, c));
    Eigen::Vector3d centre = camera.centre();
    put_split(out + 9, centre);
    out[15] = static_cast<float>(camera.fx);
    out[16] = static_cast<float>(camera.fy);
    out[17] = static_cast<float>(camera.cx);
    out[18] = static_cast<float>(camera.cy);
    out[19] = static_cast<float>(1.3 * camera.width / (2 * camera.fx));
    out[20] = static_cast<float>(1.3 * camera.height / (2 * camera.fy));
    out[21] = near;
    if (mirror) centre = 2 * Eigen::Vector3d((*mirror)[0], (*mirror)[1], (*mirror)[2]) - centre;
    put_split(out + 22, centre);
  }
  return ctx.upload({static_cast<long>(cameras.size()), kViewFloats}, data, Type::f32, "views");
}

Projected project(Context& ctx, const DeviceGaussians& g, const Tensor& views, long view, int width, int height) {
  Dims d;
  d.bind("means", g.means, {"K", "3"}).bind("scales", g.scales, {"K", "3"}).bind("quats", g.quats, {"K", "4"});
  d.bind("opacities", g.opacities, {"K"}).bind("sh", g.sh, {"K", "S", "3"}).bind("views", views, {"V", "32"});
  const long k = d["K"], s = d["S"];
  if (s != 1 && s != 4 && s != 9 && s != 16) fail(Status::internal, "project: {} spherical harmonics", s);
  if (view < 0 || view >= d["V"]) fail(Status::internal, "project: view {} of {}", view, d["V"]);
  // Rects hold 16 bits per tile index, kernels count tiles and Gaussians in 31.
  if (tiles_along(width) > 65535 || tiles_along(height) > 65535)
    fail(Status::usage, "a picture of {} x {} pixels: at most 1048560 along an edge can be drawn", width, height);
  if (k >= (1L << 31)) fail(Status::memory, "{} Gaussians: at most 2^31 - 1 can be drawn at once", k);

  Projected out{ctx.tensor({k, 12}, Type::f32, "splat.records"), ctx.tensor({k, 2}, Type::u32, "splat.rects"),
                ctx.tensor({k}, Type::u32, "splat.counts"), ctx.tensor({k}, Type::u32, "splat.keys")};
  const double n = static_cast<double>(k);
  ctx.launch({"project", "project", ""}, items(k),
             {n * (200.0 + 10.0 * static_cast<double>(s)), n * (44.0 + 12.0 * static_cast<double>(s) + 64.0)}, g.means,
             g.scales, g.quats, g.opacities, g.sh, views, static_cast<int>(view), out.records, out.rects, out.counts,
             out.keys, static_cast<int>(k), static_cast<int>(s), static_cast<int>(tiles_along(width)),
             static_cast<int>(tiles_along(height)));
  return out;
}

}  // namespace vsplat
