#include "model/ops/fit/adamw.h"

#include <cmath>
#include <limits>

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kGroup = 64, kBlock = 64 * 32;  // as cl/fit/adamw.cl: GROUP, GROUP * EACH

long blocks_of(long n) { return (n + kBlock - 1) / kBlock; }

// Elements, which kernels count with an int (and a group may count past the end).
int count_of(const char* what, const Tensor& t) {
  if (t.type() != Type::f32 || t.count() > std::numeric_limits<int>::max() - kBlock)
    fail(Status::internal, "{}: {} found, f32 and fewer than 2^31 elements expected", what, t.describe());
  return static_cast<int>(t.count());
}

}  // namespace

void gradient_clip(Context& ctx, const GradientClip& a) {
  Dims().bind("out", a.out, {"2"});
  long blocks = 0;
  for (const Tensor& grad : a.grads) {
    if (grad) blocks += blocks_of(count_of("gradient", grad));
  }
  if (blocks > std::numeric_limits<int>::max() - kGroup)
    fail(Status::internal, "gradients of {} blocks: fewer than 2^31 are possible", blocks);
  const Tensor sums = ctx.tensor({blocks}, Type::f32, "clip.sums");
  long first = 0;
  for (const Tensor& grad : a.grads) {
    if (!grad || grad.count() == 0) continue;
    const auto n = static_cast<double>(grad.count());
    const bool cpu = ctx.flavour() == Flavour::cpu;
    ctx.launch({"adamw", cpu ? "adamw_squares_cpu" : "adamw_squares", "", "adamw_squares"},
               groups(blocks_of(grad.count()), cpu ? 1 : kGroup), {2 * n, 4 * n}, grad,
               written(sums, first, blocks_of(grad.count())), grad.count(), first);
    first += blocks_of(grad.count());
  }
  ctx.launch({"adamw", "adamw_clip", ""}, groups(1, kGroup),
             {4.0 * static_cast<double>(blocks), 4.0 * static_cast<double>(blocks)}, sums, written(a.out), blocks,
             a.scale, a.max_norm);
}

void adamw_step(Context& ctx, const AdamwStep& a) {
  const int count = count_of("param", a.param);
  Dims dims;
  dims.like("m", a.m, "param", a.param).like("v", a.v, "param", a.param);
  if (a.grad) dims.like("grad", a.grad, "param", a.param);
  dims.bind_optional("clip", a.clip, {"2"});
  if (a.step < 1) fail(Status::internal, "adamw: step {}, steps count from 1", a.step);
  if (count == 0) return;
  const auto t = static_cast<double>(a.step);
  const double rate = a.lr / (1 - std::pow(a.beta1, t));
  const double root = 1 / std::sqrt(1 - std::pow(a.beta2, t));
  ctx.launch({"adamw", "adamw_step", ""}, items(count), {15.0 * count, 28.0 * count}, written(a.param), a.grad,
             written(a.m), written(a.v), a.clip, count, static_cast<float>(1 - a.beta1),
             static_cast<float>(1 - a.beta2), static_cast<float>(a.eps), static_cast<float>(a.lr * a.weight_decay),
             static_cast<float>(rate), static_cast<float>(root));
}

void average_step(Context& ctx, const Tensor& average, const Tensor& param, double decay) {
  const int count = count_of("param", param);
  Dims().like("average", average, "param", param);
  if (count == 0) return;
  ctx.launch({"adamw", "adamw_average", ""}, items(count), {3.0 * count, 12.0 * count}, written(average), param, count,
             static_cast<float>(1 - decay));
}

}  // namespace vsplat
