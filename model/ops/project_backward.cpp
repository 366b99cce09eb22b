#include "model/ops/project_backward.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kSumBlock = 512;  // Gaussians whose twists one work-item sums

}  // namespace

void project_backward(Context& ctx, const DeviceGaussians& g, long base, const Tensor& views, long view, bool mirrored,
                      const Projected& visible, const Tensor& offsets, const IntersectionGradients& intersections,
                      const GaussianGradients& out, const Tensor& twists) {
  Dims d;
  d.bind("means", g.means, {"K", "3"}).bind("scales", g.scales, {"K", "3"}).bind("quats", g.quats, {"K", "4"});
  d.bind("opacities", g.opacities, {"K"}).bind("sh", g.sh, {"K", "S", "3"}).bind("views", views, {"V", "32"});
  d.bind("ids", visible.ids, {"N"}, Type::u32).bind("records", visible.records, {"N", "12"});
  d.bind("rows", intersections.rows, {"M", "10"});
  d.bind("touched", intersections.touched, {"M"}, Type::u8);
  const long n = d["N"], s = d["S"];
  d.set("N + 1", n + 1).bind("offsets", offsets, {"N + 1"}, Type::u32);
  d.bind("gradient.means", out.means, {"K", "3"}).bind("gradient.scales", out.scales, {"K", "3"});
  d.bind("gradient.quats", out.quats, {"K", "4"}).bind("gradient.opacities", out.opacities, {"K"});
  d.bind("gradient.sh", out.sh, {"K", "S", "3"});
  if (s != 1 && s != 4 && s != 9 && s != 16) fail(Status::internal, "project_backward: {} spherical harmonics", s);
  if (view < 0 || view >= d["V"]) fail(Status::internal, "project_backward: view {} of {}", view, d["V"]);
  d.bind_optional("twists", twists, {"N", "6"});
  const double count = static_cast<double>(n), rows = static_cast<double>(d["M"]), sh = static_cast<double>(s);
  ctx.launch({"project_backward", "project_backward", ""}, items(n),
             {count * (450.0 + 20.0 * sh) + rows * 10, count * (180.0 + 36.0 * sh) + rows * 41}, g.means, g.scales,
             g.quats, g.opacities, g.sh, views, static_cast<int>(view), static_cast<int>(mirrored), visible.ids,
             visible.records, intersections.rows, intersections.touched, offsets, out.means, out.scales, out.quats,
             out.opacities, out.sh, twists, static_cast<int>(n), static_cast<int>(d["K"]), static_cast<int>(base),
             static_cast<int>(s));
}

Tensor sum_twists(Context& ctx, Tensor twists) {
  while (twists.dim(0) != 1) {
    const long n = twists.dim(0), blocks = std::max(1L, (n + kSumBlock - 1) / kSumBlock);
    const Tensor sums = ctx.tensor({blocks, 6}, Type::f32, "project_backward.pose");
    const double values = 6.0 * static_cast<double>(n);
    ctx.launch({"project_backward", "project_backward_pose", ""}, items(blocks * 6), {values, 4 * values}, twists, sums,
               static_cast<int>(n), static_cast<int>(kSumBlock), static_cast<int>(blocks));
    twists = sums;
  }
  return twists.reshaped({6});
}

}  // namespace vsplat
