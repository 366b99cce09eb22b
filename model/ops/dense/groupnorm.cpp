#include "model/ops/dense/groupnorm.h"

#include <algorithm>

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// Rows per chunk. Few enough chunks that merging them costs little, enough of them to fill the device.
long chunk_rows(Flavour flavour, long n) {
  if (flavour == Flavour::cpu) return std::clamp(n / 64, 32L, 512L);
  return std::max(64L, (n + 255) / 256);
}

void check_groups(long channels, int groups) {
  if (groups < 1 || channels % groups != 0)
    fail(Status::internal, "groupnorm: {} channels cannot be cut in {} groups", channels, groups);
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
      .bind("shift", a.shift, {"C"})
      .bind_optional("mean", a.mean, {"C"})
      .bind_optional("rstd", a.rstd, {"C"});
  check_groups(c, a.groups);
  Tensor channel_mean, channel_m2;
  if (n > 0) {
    const bool cpu = ctx.flavour() == Flavour::cpu;
    const long rows = chunk_rows(ctx.flavour(), n), chunks = (n + rows - 1) / rows;
    const Tensor mean = ctx.tensor({chunks, c}, Type::f32, "groupnorm.mean");
    const Tensor m2 = ctx.tensor({chunks, c}, Type::f32, "groupnorm.m2");
    const auto reduce = [&](const Tensor& x, long width, long channel) {
      const double count = static_cast<double>(n) * static_cast<double>(width);
      const Range range = cpu ? groups(chunks, 1) : groups((width + 31) / 32, 32, chunks);
      const auto so_far = [&](const Tensor& t) { return channel + width == c ? written(t) : written_somewhere(t); };
      ctx.launch({"groupnorm", cpu ? "groupnorm_forward_chunks_cpu" : "groupnorm_forward_chunks_gpu", ""}, range,
                 {3 * count, 4 * count}, x, so_far(mean), so_far(m2), n, width, channel, c, rows);
    };
    reduce(a.x0, c0, 0);
    if (a.x1) reduce(a.x1, c1, c0);
    channel_mean = ctx.tensor({c}, Type::f32, "groupnorm.channel_mean");
    channel_m2 = ctx.tensor({c}, Type::f32, "groupnorm.channel_m2");
    const double partials = static_cast<double>(chunks) * static_cast<double>(c);
    ctx.launch({"groupnorm", "groupnorm_forward_channels", ""}, items(c, 16), {8 * partials, 8 * partials}, mean, m2,
               written(channel_mean), written(channel_m2), n, c, rows, chunks);
  }
  ctx.launch({"groupnorm", "groupnorm_forward_scale", ""}, items(c, 16), {}, channel_mean, channel_m2, a.gamma, a.beta,
             written(a.scale), written(a.shift), written(a.mean), written(a.rstd), n, c, a.groups, a.eps);
}

void groupnorm_backward(Context& ctx, const GroupNormBackward& a) {
  Dims d;
  d.bind("x0", a.x0, {"N", "C0"}).bind_optional("x1", a.x1, {"N", "C1"}).bind("dx0", a.dx0, {"N", "C0"});
  if (a.x1) d.bind("dx1", a.dx1, {"N", "C1"});
  const long n = d["N"], c0 = d["C0"], c1 = a.x1 ? d["C1"] : 0, c = c0 + c1;
  d.set("C", c)
      .bind("gamma", a.gamma, {"C"})
      .bind("scale", a.scale, {"C"})
      .bind("shift", a.shift, {"C"})
      .bind("mean", a.mean, {"C"})
      .bind("rstd", a.rstd, {"C"})
      .bind("dy", a.dy, {"N", "C"})
      .bind("dgamma", a.dgamma, {"C"})
      .bind("dbeta", a.dbeta, {"C"});
  check_groups(c, a.groups);
  if (n == 0) return;
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const long rows = chunk_rows(ctx.flavour(), n), chunks = (n + rows - 1) / rows;
  const Tensor sums = ctx.tensor({chunks, c}, Type::f32, "groupnorm.sums");
  const Tensor sums_u = ctx.tensor({chunks, c}, Type::f32, "groupnorm.sums_u");
  const auto reduce = [&](const Tensor& x, long width, long channel) {
    const double count = static_cast<double>(n) * static_cast<double>(width);
    const Range range = cpu ? groups(chunks, 1) : groups((width + 31) / 32, 32, chunks);
    const auto so_far = [&](const Tensor& t) { return channel + width == c ? written(t) : written_somewhere(t); };
    ctx.launch({"groupnorm", cpu ? "groupnorm_backward_chunks_cpu" : "groupnorm_backward_chunks_gpu", ""}, range,
               {30 * count, 8 * count}, x, a.dy, a.scale, a.shift, a.mean, a.rstd, so_far(sums), so_far(sums_u), n,
               width, channel, c, rows);
  };
  reduce(a.x0, c0, 0);
  if (a.x1) reduce(a.x1, c1, c0);

  const Tensor channel_sums = ctx.tensor({c}, Type::f32, "groupnorm.channel_sums");
  const Tensor channel_sums_u = ctx.tensor({c}, Type::f32, "groupnorm.channel_sums_u");
  const Tensor group_mean = ctx.tensor({c}, Type::f32, "groupnorm.group_mean");
  const Tensor group_mean_u = ctx.tensor({c}, Type::f32, "groupnorm.group_mean_u");
  const double partials = static_cast<double>(chunks) * static_cast<double>(c);
  ctx.launch({"groupnorm", "groupnorm_backward_channels", ""}, items(c, 16), {2 * partials, 8 * partials}, sums, sums_u,
             written(channel_sums), written(channel_sums_u), written(a.dgamma), written(a.dbeta), c, chunks);
  ctx.launch({"groupnorm", "groupnorm_backward_groups", ""}, items(c, 16), {}, channel_sums, channel_sums_u, a.gamma,
             written(group_mean), written(group_mean_u), n, c, a.groups);

  const auto finish = [&](const Tensor& x, const Tensor& dx, long width, long channel) {
    const double count = static_cast<double>(n) * static_cast<double>(width);
    ctx.launch({"groupnorm", cpu ? "groupnorm_backward_cpu" : "groupnorm_backward_gpu", ""}, items(cpu ? n : n * width),
               {30 * count, 12 * count}, x, a.dy, a.scale, a.shift, a.mean, a.rstd, a.gamma, group_mean, group_mean_u,
               written(dx), a.add ? 1 : 0, n, width, channel, c);
  };
  finish(a.x0, a.dx0, c0, 0);
  if (a.x1) finish(a.x1, a.dx1, c1, c0);
}

}  // namespace vsplat
