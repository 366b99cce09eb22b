#include "model/ops/networks/decode.h"

#include <cmath>

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kLocal = 64;

// softplus of this is the scale at a raw value of 0: a sixth of a voxel, so that three deviations span half a voxel.
float scale_shift(long volume) {
  return static_cast<float>(std::log(std::expm1(1.0 / (6.0 * static_cast<double>(volume)))));
}

template <class Tensors>  // DeviceGaussians or GaussianGradients
Dims& bind(Dims& d, const Tensors& g, const std::string& name, const std::string& k, const char* scales = "3") {
  d.bind(name + ".means", g.means, {k, "3"})
      .bind(name + ".scales", g.scales, {k, scales})
      .bind(name + ".quats", g.quats, {k, "4"});
  return d.bind(name + ".opacities", g.opacities, {k}).bind(name + ".sh", g.sh, {k, "S", "3"});
}

// Arguments that both directions of the coarse decoder share.
struct Coarse {
  long voxels, count, each, exponential;
  float reach, shift;

  Coarse(long volume, const CoarseKind& kind)
      : voxels(volume * volume * volume),
        count(voxels * kind.each),
        each(kind.each),
        exponential(kind.exponential ? 1 : 0),
        reach(static_cast<float>(kind.reach / static_cast<double>(volume))),
        shift(kind.exponential ? static_cast<float>(-std::log(3.0 * static_cast<double>(volume)))
                               : scale_shift(volume)) {}

  template <class Tensors>
  void bind(Dims& d, const char* name, const Tensors& g) const {
    d.set("R^3", voxels).set("K R^3", count);
    vsplat::bind(d, g, name, "K R^3", "D");
    if (d["D"] != 2 && d["D"] != 3) fail(Status::internal, "decode: {} scales, 2 or 3 are expected", d["D"]);
    d.set("A", 8 + d["D"] + 3 * d["S"]).set("K A", each * d["A"]);
  }
};

Cost cost_of(double gaussians, double numbers) { return {gaussians * 60, gaussians * numbers * 8}; }
Cost backward_cost(double gaussians, double numbers) { return {gaussians * 100, gaussians * numbers * 12}; }

}  // namespace

DeviceGaussians make_gaussians(Context& ctx, long count, long sh_count, const std::string& what, long scales) {
  DeviceGaussians g;
  g.means = ctx.tensor({count, 3}, Type::f32, what + ".means");
  g.scales = ctx.tensor({count, scales}, Type::f32, what + ".scales");
  g.quats = ctx.tensor({count, 4}, Type::f32, what + ".quats");
  g.opacities = ctx.tensor({count}, Type::f32, what + ".opacities");
  g.sh = ctx.tensor({count, sh_count, 3}, Type::f32, what + ".sh");
  return g;
}

void decode_coarse_forward(Context& ctx, const DecodeCoarseForward& a) {
  const Coarse c(a.volume, a.kind);
  Dims d;
  c.bind(d, "out", a.out);
  d.bind("raw", a.raw, {"R^3", "K A"});
  ctx.launch({"decode", "decode_coarse_forward", ""}, items(c.count, kLocal),
             cost_of(static_cast<double>(c.count), static_cast<double>(d["A"])), a.raw, written(a.out.means),
             written(a.out.scales), written(a.out.quats), written(a.out.opacities), written(a.out.sh), a.volume, c.each,
             3 * d["S"], d["D"], c.exponential, c.reach, c.shift);
}

void decode_coarse_backward(Context& ctx, const DecodeCoarseBackward& a) {
  const Coarse c(a.volume, a.kind);
  Dims d;
  c.bind(d, "dout", a.dout);
  d.bind("raw", a.raw, {"R^3", "K A"}).bind("draw", a.draw, {"R^3", "K A"});
  ctx.launch({"decode", "decode_coarse_backward", ""}, items(c.count, kLocal),
             backward_cost(static_cast<double>(c.count), static_cast<double>(d["A"])), a.raw, a.dout.means,
             a.dout.scales, a.dout.quats, a.dout.opacities, a.dout.sh, written(a.draw), a.volume, c.each, 3 * d["S"],
             d["D"], c.exponential, c.reach, c.shift);
}

void decode_fine_forward(Context& ctx, const DecodeFineForward& a) {
  Dims d;
  bind(d, a.out, "out", "K");
  d.bind("centres", a.centres, {"P", "3"}).bind("div_offset", a.div_offset, {"M", "3"});
  const long sh = 3 * d["S"], p = d["P"], m = d["M"], n = p * m;
  d.set("M A", m * (11 + sh)).bind("raw", a.raw, {"P", "M A"});
  if (d["K"] < n) fail(Status::internal, "decode: {} Gaussians do not fit in {}", n, a.out.means.describe());
  ctx.launch({"decode", "decode_fine_forward", ""}, items(n, kLocal),
             cost_of(static_cast<double>(n), static_cast<double>(11 + sh)), a.raw, a.centres, a.div_offset,
             written(a.out.means, 3 * n), written(a.out.scales, 3 * n), written(a.out.quats, 4 * n),
             written(a.out.opacities, n), written(a.out.sh, sh * n), p, m, sh, 0.125f / static_cast<float>(a.volume),
             scale_shift(a.volume));
}

void decode_fine_backward(Context& ctx, const DecodeFineBackward& a) {
  Dims d;
  bind(d, a.dout, "dout", "K");
  d.bind("dcentres", a.dcentres, {"P", "3"}).bind("raw", a.raw, {"P", "M A"}).bind("draw", a.draw, {"P", "M A"});
  const long sh = 3 * d["S"], p = d["P"], m = d["M A"] / (11 + sh), n = p * m;
  d.set("M A", m * (11 + sh));
  if (d["K"] < n) fail(Status::internal, "decode: gradients of {} Gaussians expected, {} found", n, d["K"]);
  ctx.launch({"decode", "decode_fine_backward", ""}, items(n, kLocal),
             backward_cost(static_cast<double>(n), static_cast<double>(11 + sh)), a.raw, a.dout.means, a.dout.scales,
             a.dout.quats, a.dout.opacities, a.dout.sh, written(a.draw), written(a.dcentres), p, m, sh,
             0.125f / static_cast<float>(a.volume), scale_shift(a.volume));
}

namespace {

// Some of K Gaussians from the raw numbers of P points; -> 3 S.
template <class Tensors>
long bind_points(Dims& d, const Tensors& g, const char* name, const Tensor& raw, const Tensor& points, long row0) {
  bind(d, g, name, "K");
  const long sh = 3 * d["S"];
  d.set("A - 3", 8 + sh).bind("raw", raw, {"P", "A - 3"}).bind("points", points, {"P", "3"});
  if (row0 < 0 || d["K"] < row0 + d["P"])
    fail(Status::internal, "decode: rows {} to {} of {}", row0, row0 + d["P"], g.means.describe());
  return sh;
}

}  // namespace

void decode_points_forward(Context& ctx, const DecodePointsForward& a) {
  Dims d;
  const long sh = bind_points(d, a.out, "out", a.raw, a.points, a.row0), p = d["P"];
  ctx.launch({"decode", "decode_points_forward", ""}, items(p, kLocal),
             cost_of(static_cast<double>(p), static_cast<double>(11 + sh)), a.raw, a.points,
             written(a.out.means, 3 * a.row0, 3 * p), written(a.out.scales, 3 * a.row0, 3 * p),
             written(a.out.quats, 4 * a.row0, 4 * p), written(a.out.opacities, a.row0, p),
             written(a.out.sh, sh * a.row0, sh * p), p, sh, a.row0, static_cast<float>(std::log(a.unit)));
}

void decode_points_backward(Context& ctx, const DecodePointsBackward& a) {
  Dims d;
  const long sh = bind_points(d, a.dout, "dout", a.raw, a.dpoints, a.row0), p = d["P"];
  d.bind("draw", a.draw, {"P", "A - 3"});
  ctx.launch({"decode", "decode_points_backward", ""}, items(p, kLocal),
             backward_cost(static_cast<double>(p), static_cast<double>(11 + sh)), a.raw, a.dout.means, a.dout.scales,
             a.dout.quats, a.dout.opacities, a.dout.sh, written(a.draw), written(a.dpoints), p, sh, a.row0,
             static_cast<float>(std::log(a.unit)));
}

void decode_adjusted_forward(Context& ctx, const DecodeAdjustedForward& a) {
  Dims d;
  bind(d, a.skeleton, "skeleton", "P");
  bind(d, a.out, "out", "K");
  const long sh = 3 * d["S"], p = d["P"];
  d.set("update", sh + 1).bind("raw", a.raw, {"P", "update"});
  if (a.row0 < 0 || d["K"] < a.row0 + p) {
    fail(Status::internal, "decode: rows {} to {} of {}", a.row0, a.row0 + p, a.out.means.describe());
  }
  ctx.launch({"decode", "decode_adjusted_forward", ""}, items(p, kLocal),
             cost_of(static_cast<double>(p), static_cast<double>(11 + sh)), a.raw, a.skeleton.means, a.skeleton.scales,
             a.skeleton.quats, a.skeleton.opacities, written(a.out.means, 3 * a.row0, 3 * p),
             written(a.out.scales, 3 * a.row0, 3 * p), written(a.out.quats, 4 * a.row0, 4 * p),
             written(a.out.opacities, a.row0, p), written(a.out.sh, sh * a.row0, sh * p), p, sh, a.row0);
}

void decode_adjusted_backward(Context& ctx, const DecodeAdjustedBackward& a) {
  Dims d;
  bind(d, a.dout, "dout", "K");
  d.bind("opacities", a.opacities, {"P"}).bind("dskeleton.means", a.dskeleton.means, {"P", "3"});
  d.bind("dskeleton.scales", a.dskeleton.scales, {"P", "3"}).bind("dskeleton.quats", a.dskeleton.quats, {"P", "4"});
  d.bind("dskeleton.opacities", a.dskeleton.opacities, {"P"});
  const long sh = 3 * d["S"], p = d["P"];
  d.set("update", sh + 1).bind("raw", a.raw, {"P", "update"}).bind("draw", a.draw, {"P", "update"});
  if (a.row0 < 0 || d["K"] < a.row0 + p) {
    fail(Status::internal, "decode: rows {} to {} of {}", a.row0, a.row0 + p, a.dout.means.describe());
  }
  ctx.launch({"decode", "decode_adjusted_backward", ""}, items(p, kLocal),
             backward_cost(static_cast<double>(p), static_cast<double>(11 + sh)), a.raw, a.opacities, a.dout.means,
             a.dout.scales, a.dout.quats, a.dout.opacities, a.dout.sh, written(a.draw), written(a.dskeleton.means),
             written(a.dskeleton.scales), written(a.dskeleton.quats), written(a.dskeleton.opacities), p, sh, a.row0);
}

}  // namespace vsplat
