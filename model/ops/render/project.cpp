#include "model/ops/render/project.h"

#include <cmath>

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kViewFloats = 32;
constexpr long kSumBlock = 512;  // Gaussians whose pose gradients one work-item sums

// A position as a float and its rounding error: differences of nearby positions far from the origin stay exact.
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

long projection_width(const Context& ctx) {
  return ctx.flavour() == Flavour::cpu && ctx.device().native_float_width >= 4 ? 16 : 1;
}

void bind_gaussians(Dims& d, const DeviceGaussians& g, const char* n, GaussianKind kind) {
  d.bind("means", g.means, {n, "3"}).bind("scales", g.scales, {n, std::to_string(scales_of(kind))});
  d.bind("quats", g.quats, {n, "4"}).bind("opacities", g.opacities, {n}).bind("sh", g.sh, {n, "S", "3"});
  const long s = d["S"];
  if (s != 1 && s != 4 && s != 9 && s != 16) fail(Status::internal, "project: {} spherical harmonics", s);
}

namespace {

struct Launch {
  long width;  // Gaussians per work-item
  std::string defines;
};

Launch launch_of(const Context& ctx, bool antialias) {
  const long width = projection_width(ctx);
  return {width, "-DWIDTH=" + std::to_string(width) + (antialias ? " -DANTIALIAS" : "")};
}

Range range_of(const Launch& l, long n) { return items((n + l.width - 1) / l.width, l.width == 1 ? 64 : 16); }

}  // namespace

void check_culling(const Dims& d, long view, long base, int width, int height) {
  const long n = d["n"];
  if (view < 0 || view >= d["V"]) fail(Status::internal, "project: view {} of {}", view, d["V"]);
  if (base < 0 || base + n > d["K"]) fail(Status::internal, "project: {} Gaussians from {} of {}", n, base, d["K"]);
  // Rects hold 16 bits per tile index, kernels count tiles and Gaussians in 31.
  if (tiles_along(width) > 65535 || tiles_along(height) > 65535)
    fail(Status::usage, "a picture of {} x {} pixels: at most 1048560 along an edge can be drawn", width, height);
  if (d["K"] >= (1L << 31)) fail(Status::memory, "{} Gaussians: at most 2^31 - 1 can be drawn at once", d["K"]);
}

void project_cull(Context& ctx, const DeviceGaussians& g, long base, const Tensor& views, long view, int width,
                  int height, const Culled& out, bool antialias) {
  Dims d;
  bind_gaussians(d, g, "n", GaussianKind::volume);
  d.bind("views", views, {"V", "32"}).bind("rects", out.rects, {"K", "2"}, Type::u32);
  d.bind("keys", out.keys, {"K"}, Type::u32);
  const long n = d["n"];
  check_culling(d, view, base, width, height);
  const Launch l = launch_of(ctx, antialias);
  const double count = static_cast<double>(n);
  ctx.launch({"project", "project_cull", l.defines}, range_of(l, n), {count * 190, count * 56}, g.means, g.scales,
             g.quats, g.opacities, views, view, written(out.rects), written(out.keys), base, n, tiles_along(width),
             tiles_along(height));
}

void project_forward(Context& ctx, const ProjectForward& a) {
  const DeviceGaussians& g = a.chunk;
  Dims d;
  bind_gaussians(d, g, "n", GaussianKind::volume);
  d.bind("views", a.views, {"V", "32"}).bind("ids", a.ids, {"N"}, Type::u32).bind("records", a.records, {"N", "12"});
  if (a.from < 0 || a.from + a.n > d["N"]) fail(Status::internal, "project: {} from {} of {}", a.n, a.from, d["N"]);
  const Launch l = launch_of(ctx, a.antialias);
  const double count = static_cast<double>(a.n), s = static_cast<double>(d["S"]);
  ctx.launch({"project", "project_forward", l.defines}, range_of(l, a.n),
             {count * (180 + 8 * s), count * (96 + 12 * s)}, g.means, g.scales, g.quats, g.opacities, g.sh, a.views,
             a.view, a.ids, written(a.records, 12 * a.from, 12 * a.n), a.base, a.from, a.n, d["S"]);
}

void project_backward(Context& ctx, const ProjectBackward& a) {
  const DeviceGaussians& g = a.chunk;
  Dims d;
  bind_gaussians(d, g, "K", GaussianKind::volume);
  d.bind("views", a.views, {"V", "32"});
  d.bind("ids", a.visible.ids, {"N"}, Type::u32).bind("records", a.visible.records, {"N", "12"});
  d.bind("rows", a.intersections.rows, {"M", "10"});
  d.bind("touched", a.intersections.touched, {"M"}, Type::u8);
  const long n = d["N"], s = d["S"];
  d.set("N + 1", n + 1).bind("offsets", a.offsets, {"N + 1"}, Type::u32);
  d.bind("dchunk.means", a.dchunk.means, {"K", "3"}).bind("dchunk.scales", a.dchunk.scales, {"K", "3"});
  d.bind("dchunk.quats", a.dchunk.quats, {"K", "4"}).bind("dchunk.opacities", a.dchunk.opacities, {"K"});
  d.bind("dchunk.sh", a.dchunk.sh, {"K", "S", "3"});
  if (a.view < 0 || a.view >= d["V"]) fail(Status::internal, "project_backward: view {} of {}", a.view, d["V"]);
  d.bind_optional("pose_gradients", a.pose_gradients, {"N", "6"});
  const double count = static_cast<double>(n), rows = static_cast<double>(d["M"]), sh = static_cast<double>(s);
  ctx.launch({"project_backward", "project_backward", a.antialias ? "-DANTIALIAS" : ""}, items(n),
             {count * (450.0 + 20.0 * sh) + rows * 10, count * (180.0 + 36.0 * sh) + rows * 41}, g.means, g.scales,
             g.quats, g.opacities, g.sh, a.views, a.view, static_cast<int>(a.mirrored), a.visible.ids,
             a.visible.records, a.intersections.rows, a.intersections.touched, a.offsets, written(a.dchunk.means),
             written(a.dchunk.scales), written(a.dchunk.quats), written(a.dchunk.opacities), written(a.dchunk.sh),
             written_somewhere(a.pose_gradients), n, d["K"], a.base, s);
}

void project_pulls(Context& ctx, const ProjectPulls& a) {
  Dims d;
  d.bind("ids", a.visible.ids, {"N"}, Type::u32).bind("rows", a.intersections.rows, {"M", "2"});
  d.bind("touched", a.intersections.touched, {"M"}, Type::u8).bind("pulls", a.pulls, {"K", "2"});
  const long n = d["N"];
  d.set("N + 1", n + 1).bind("offsets", a.offsets, {"N + 1"}, Type::u32);
  const double rows = static_cast<double>(d["M"]);
  ctx.launch({"project_backward", "project_backward_pulls", ""}, items(n),
             {2 * rows, 9 * rows + 24.0 * static_cast<double>(n)}, a.visible.ids, a.intersections.rows,
             a.intersections.touched, a.offsets, written(a.pulls), n, static_cast<float>(a.by_u),
             static_cast<float>(a.by_v));
}

Tensor pull_lengths(Context& ctx, const Tensor& pulls) {
  const long k = Dims().bind("pulls", pulls, {"K", "2"})["K"];
  const Tensor out = ctx.tensor({k}, Type::f32, "pull lengths");
  const auto count = static_cast<double>(k);
  ctx.launch({"project_backward", "project_backward_pull_lengths", ""}, items(k), {4 * count, 12 * count}, pulls,
             written(out), k);
  return out;
}

Tensor sum_pose_gradients(Context& ctx, Tensor pose_gradients) {
  while (pose_gradients.dim(0) != 1) {
    const long n = pose_gradients.dim(0), blocks = std::max(1L, (n + kSumBlock - 1) / kSumBlock);
    const Tensor sums = ctx.tensor({blocks, 6}, Type::f32, "project_backward.pose");
    const double values = 6.0 * static_cast<double>(n);
    ctx.launch({"project_backward", "project_backward_pose", ""}, items(blocks * 6), {values, 4 * values},
               pose_gradients, written(sums), n, kSumBlock, blocks);
    pose_gradients = sums;
  }
  return pose_gradients.reshaped({6});
}

}  // namespace vsplat
