#include "model/ops/render/project_surfels.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

int number_of(SurfelRevision revision) { return revision == SurfelRevision::current ? 1 : 0; }

struct Launch {
  KernelId id;
  Range range;
};

Launch launch_of(const Context& ctx, const char* kernel, long n) {
  const long width = projection_width(ctx);
  return {{"project_surfels", kernel, "-DWIDTH=" + std::to_string(width)},
          items((n + width - 1) / width, width == 1 ? 64 : 16)};
}

}  // namespace

void project_surfels_cull(Context& ctx, const DeviceGaussians& g, long base, const Tensor& views, long view, int width,
                          int height, SurfelRevision revision, const Culled& out) {
  Dims d;
  bind_gaussians(d, g, "n", GaussianKind::surfel);
  d.bind("views", views, {"V", "32"}).bind("rects", out.rects, {"K", "2"}, Type::u32);
  d.bind("keys", out.keys, {"K"}, Type::u32);
  check_culling(d, view, base, width, height);
  const long n = d["n"];
  const Launch l = launch_of(ctx, "project_surfels_cull", n);
  const double count = static_cast<double>(n);
  ctx.launch(l.id, l.range, {count * 260, count * 52}, g.means, g.scales, g.quats, g.opacities, views, view,
             number_of(revision), written(out.rects), written(out.keys), base, n, tiles_along(width),
             tiles_along(height));
}

void project_surfels_forward(Context& ctx, const ProjectSurfelsForward& a) {
  const DeviceGaussians& g = a.chunk;
  Dims d;
  bind_gaussians(d, g, "n", GaussianKind::surfel);
  d.bind("views", a.views, {"V", "32"}).bind("ids", a.ids, {"N"}, Type::u32).bind("records", a.records, {"N", "20"});
  if (a.view < 0 || a.view >= d["V"]) fail(Status::internal, "project_surfels: view {} of {}", a.view, d["V"]);
  if (a.from < 0 || a.from + a.n > d["N"])
    fail(Status::internal, "project_surfels: {} from {} of {}", a.n, a.from, d["N"]);
  const Launch l = launch_of(ctx, "project_surfels_forward", a.n);
  const double count = static_cast<double>(a.n), s = static_cast<double>(d["S"]);
  ctx.launch(l.id, l.range, {count * (260 + 8 * s), count * (124 + 12 * s)}, g.means, g.scales, g.quats, g.opacities,
             g.sh, a.views, a.view, number_of(a.revision), a.ids,
             written(a.records, kSurfelRecord * a.from, kSurfelRecord * a.n), a.base, a.from, a.n, d["S"]);
}

void project_surfels_backward(Context& ctx, const ProjectSurfelsBackward& a) {
  const DeviceGaussians& g = a.chunk;
  Dims d;
  bind_gaussians(d, g, "K", GaussianKind::surfel);
  d.bind("views", a.views, {"V", "32"});
  d.bind("ids", a.visible.ids, {"N"}, Type::u32).bind("records", a.visible.records, {"N", "20"});
  d.bind("rows", a.intersections.rows, {"M", "20"});
  d.bind("touched", a.intersections.touched, {"M"}, Type::u8);
  const long n = d["N"], s = d["S"];
  d.set("N + 1", n + 1).bind("offsets", a.offsets, {"N + 1"}, Type::u32);
  d.bind("dchunk.means", a.dchunk.means, {"K", "3"}).bind("dchunk.scales", a.dchunk.scales, {"K", "2"});
  d.bind("dchunk.quats", a.dchunk.quats, {"K", "4"}).bind("dchunk.opacities", a.dchunk.opacities, {"K"});
  d.bind("dchunk.sh", a.dchunk.sh, {"K", "S", "3"});
  if (a.view < 0 || a.view >= d["V"]) fail(Status::internal, "project_surfels_backward: view {} of {}", a.view, d["V"]);
  d.bind_optional("pose_gradients", a.pose_gradients, {"N", "6"});
  const double count = static_cast<double>(n), rows = static_cast<double>(d["M"]), sh = static_cast<double>(s);
  ctx.launch({"project_surfels_backward", "project_surfels_backward", ""}, items(n),
             {count * (600.0 + 20.0 * sh) + rows * 20, count * (210.0 + 36.0 * sh) + rows * 81}, g.means, g.scales,
             g.quats, g.opacities, g.sh, a.views, a.view, static_cast<int>(a.mirrored), number_of(a.revision),
             a.visible.ids, a.visible.records, a.intersections.rows, a.intersections.touched, a.offsets,
             written(a.dchunk.means), written(a.dchunk.scales), written(a.dchunk.quats), written(a.dchunk.opacities),
             written(a.dchunk.sh), written_somewhere(a.pose_gradients), n, d["K"], a.base, s);
}

}  // namespace vsplat
