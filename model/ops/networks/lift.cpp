#include "model/ops/networks/lift.h"

#include <fmt/format.h>

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr int voxels_per_group = 8;

struct Launch {
  Range range;
  std::string defines;
};

// One work-item of 16 lanes processes all channels of a voxel, or 32 work-items of 4 lanes share them.
Launch shape_of(Flavour flavour, long n) {
  const bool cpu = flavour == Flavour::cpu;
  const long count = (n + voxels_per_group - 1) / voxels_per_group;
  return {cpu ? groups(count, 1) : groups(count, 32),
          fmt::format("-DLANES={} -DVOXELS={}", cpu ? 16 : 4, voxels_per_group)};
}

// Moves at least four texels per sample, and every map once.
Cost cost_of(const Tensor& maps, long n, long views, long c, double per_sample) {
  const double samples = static_cast<double>(n) * static_cast<double>(views) * static_cast<double>(c);
  return {per_sample * samples, static_cast<double>(maps.bytes()) + 4.0 * static_cast<double>(n * c)};
}

}  // namespace

void lift_corners(Context& ctx, const LiftCorners& a) {
  Dims d;
  d.bind("w2c", a.cameras.w2c, {"V", "4", "4"}).bind("intrinsics", a.cameras.intrinsics, {"V", "4"});
  d.bind("index", a.index, {"n", "V", "4"}, Type::i32).bind("weight", a.weight, {"n", "V", "4"});
  const long count = d["n"] * d["V"];
  ctx.launch({"lift", "lift_corners", shape_of(ctx.flavour(), 1).defines}, items(count),
             {40.0 * static_cast<double>(count), 32.0 * static_cast<double>(count)}, a.cameras.w2c,
             a.cameras.intrinsics, written(a.index), written(a.weight), a.first, d["n"], d["V"], a.volume, a.tokens,
             static_cast<float>(a.image), a.half_pixel ? 0.5f : 0.0f);
}

void lift_variance_forward(Context& ctx, const LiftVarianceForward& a) {
  Dims d;
  d.bind("maps", a.maps, {"texels", "C"}).bind("index", a.index, {"n", "V", "4"}, Type::i32);
  d.bind("weight", a.weight, {"n", "V", "4"}).bind("out", a.out, {"n", "C"});
  const Launch shape = shape_of(ctx.flavour(), d["n"]);
  ctx.launch({"lift", "lift_variance_forward", shape.defines}, shape.range, cost_of(a.maps, d["n"], d["V"], d["C"], 14),
             a.maps, a.index, a.weight, written(a.out), d["n"], d["V"], d["C"]);
}

void lift_mean_forward(Context& ctx, const LiftMeanForward& a) {
  Dims d;
  d.bind("maps", a.maps, {"texels", "C"}).bind("index", a.index, {"n", "V", "4"}, Type::i32);
  d.bind("weight", a.weight, {"n", "V", "4"}).bind("bias", a.bias, {"C"}).bind("out", a.out, {"rows", "C"});
  if (a.first < 0 || a.first + d["n"] > d["rows"])
    fail(Status::internal, "lift_mean: rows {} to {} of {}", a.first, a.first + d["n"], d["rows"]);
  const Launch shape = shape_of(ctx.flavour(), d["n"]);
  ctx.launch({"lift", "lift_mean_forward", shape.defines}, shape.range, cost_of(a.maps, d["n"], d["V"], d["C"], 9),
             a.maps, a.index, a.weight, a.bias, written(a.out, a.first * d["C"], d["n"] * d["C"]), a.first, d["n"],
             d["V"], d["C"]);
}

void lift_samples_forward(Context& ctx, const LiftSamplesForward& a) {
  Dims d;
  d.bind("maps", a.maps, {"texels", "C"}).bind("index", a.index, {"n", "V", "4"}, Type::i32);
  d.bind("weight", a.weight, {"n", "V", "4"}).bind("out", a.out, {"n", "V", "C"});
  const Launch shape = shape_of(ctx.flavour(), d["n"]);
  Cost cost = cost_of(a.maps, d["n"], d["V"], d["C"], 8);
  cost.bytes += static_cast<double>(a.out.bytes()) * static_cast<double>(d["V"] - 1) / static_cast<double>(d["V"]);
  ctx.launch({"lift", "lift_samples_forward", shape.defines}, shape.range, cost, a.maps, a.index, a.weight,
             written(a.out), d["n"], d["V"], d["C"]);
}

void lift_variance_backward(Context& ctx, const LiftVarianceBackward& a) {
  Dims d;
  d.bind("maps", a.maps, {"texels", "C"}).bind("index", a.index, {"n", "V", "4"}, Type::i32);
  d.bind("weight", a.weight, {"n", "V", "4"}).bind("dout", a.dout, {"n", "C"}).bind("dmaps", a.dmaps, {"texels", "C"});
  const long n = d["n"], v = d["V"], c = d["C"];
  const Tensor dsamples = ctx.tensor({n * v, c}, Type::f32, "lift_variance.dsamples");
  const Launch shape = shape_of(ctx.flavour(), n);
  Cost cost = cost_of(a.maps, n, v, c, 12);
  cost.bytes += 2.0 * static_cast<double>(dsamples.bytes());
  ctx.launch({"lift", "lift_variance_backward", shape.defines}, shape.range, cost, a.maps, a.index, a.weight, a.dout,
             written(dsamples), n, v, c);
  scatter_rows(ctx, {a.plan, dsamples, 0, 4, 1, a.dmaps});
}

void lift_mean_backward(Context& ctx, const LiftMeanBackward& a) {
  scatter_rows(ctx, {a.plan, a.dout, a.first, 4 * a.views, 1.0f / static_cast<float>(a.views), a.dmaps});
}

void lift_samples_backward(Context& ctx, const LiftSamplesBackward& a) {
  Dims d;
  d.bind("dout", a.dout, {"n", "V", "C"}).bind("dmaps", a.dmaps, {"texels", "C"});
  scatter_rows(ctx, {a.plan, a.dout.reshaped({d["n"] * d["V"], d["C"]}), 0, 4, 1, a.dmaps});
}

}  // namespace vsplat
