#include "model/ops/groupnorm.h"

#include <algorithm>

#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// Rows per chunk. Few enough chunks that merging them costs little, enough of them to fill the device.
long chunk_rows(Flavour flavour, long n) {
  if (flavour == Flavour::cpu) return std::clamp(n / 64, 32L, 512L);
  return std::max(64L, (n + 255) / 256);
}

}  // namespace

void groupnorm_forward(Context& ctx, const GroupNormForward& a) {
  Dims d;
  d.bind("x0", a.x0, {"N", "C0"}).bind_optional("x1", a.x1, {"N", "C1"});
  const long n = d["N"], c0 = d["C0"], c1 = a.x1 ? a.x1.dim(1) : 0, c = c0 + c1;
  d.set("C", c)
      .bind("gamma", a.gamma, {"C"})
      .bind("beta", a.beta, {"C"})
      .bind("scale", a.scale, {"C"})
      .bind("shift", a.shift, {"C"});
  if (a.groups < 1 || c % a.groups != 0)
    fail(Status::internal, "groupnorm: {} channels cannot be cut in {} groups", c, a.groups);
  const int ni = static_cast<int>(n), ci = static_cast<int>(c);
  Tensor channel_mean, channel_m2;
  if (n > 0) {
    const bool cpu = ctx.flavour() == Flavour::cpu;
    const long rows = chunk_rows(ctx.flavour(), n), chunks = (n + rows - 1) / rows;
    const Tensor mean = ctx.tensor({chunks, c}, Type::f32, "groupnorm.mean");
    const Tensor m2 = ctx.tensor({chunks, c}, Type::f32, "groupnorm.m2");
    const auto reduce = [&](const Tensor& x, long width, long channel) {
      const double count = static_cast<double>(n) * static_cast<double>(width);
      const Range range = cpu ? groups(chunks, 1) : groups((width + 31) / 32, 32, chunks);
      ctx.launch({"groupnorm", cpu ? "groupnorm_chunks_cpu" : "groupnorm_chunks_gpu", ""}, range,
                 {3 * count, 4 * count}, x, mean, m2, ni, static_cast<int>(width), static_cast<int>(channel), ci,
                 static_cast<int>(rows));
    };
    reduce(a.x0, c0, 0);
    if (a.x1) reduce(a.x1, c1, c0);
    channel_mean = ctx.tensor({c}, Type::f32, "groupnorm.channel_mean");
    channel_m2 = ctx.tensor({c}, Type::f32, "groupnorm.channel_m2");
    const double partials = static_cast<double>(chunks) * static_cast<double>(c);
    ctx.launch({"groupnorm", "groupnorm_channels", ""}, items(c, 16), {8 * partials, 8 * partials}, mean, m2,
               channel_mean, channel_m2, ni, ci, static_cast<int>(rows), static_cast<int>(chunks));
  }
  ctx.launch({"groupnorm", "groupnorm_scale", ""}, items(c, 16), {}, channel_mean, channel_m2, a.gamma, a.beta, a.scale,
             a.shift, ni, ci, a.groups, a.eps);
}

}  // namespace vsplat
