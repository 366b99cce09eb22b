#include "model/ops/fit/splat_adam.h"

#include <cmath>

#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr long kBlock = 1024;  // BLOCK of cl/fit/splat_adam.cl

}  // namespace

void splat_adam(Context& ctx, const SplatAdam& a) {
  if (!a.param || a.param.rank() < 1 || a.param.type() != Type::f32)
    fail(Status::internal, "splat_adam: param is {}, f32 expected", a.param.describe());
  for (const Tensor& t : {a.grad, a.m, a.v})
    if (!t || t.type() != Type::f32 || t.shape() != a.param.shape())
      fail(Status::internal, "splat_adam: {} found for param {}", t.describe(), a.param.describe());
  if (a.step < 1) fail(Status::internal, "splat_adam: step {}, steps count from 1", a.step);
  const long count = a.param.count();
  if (count == 0) return;
  const long width = count / a.param.dim(0), head = a.head > 0 ? a.head : width;
  const auto t = static_cast<double>(a.step);
  const double unbiased = 1 / (1 - std::pow(a.beta1, t)), root = 1 / std::sqrt(1 - std::pow(a.beta2, t));
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const auto values = static_cast<double>(count);
  ctx.launch({"splat_adam", cpu ? "splat_adam_cpu" : "splat_adam_gpu", ""},
             cpu ? items((count + kBlock - 1) / kBlock, 1) : items(count), {15 * values, 32 * values}, written(a.param),
             written(a.grad), written(a.m), written(a.v), count, width, head, static_cast<float>(a.rate * unbiased),
             static_cast<float>(a.rate_rest * unbiased), static_cast<float>(1 - a.beta1),
             static_cast<float>(1 - a.beta2), static_cast<float>(a.eps), static_cast<float>(root), a.low, a.high,
             a.sparse ? 1 : 0);
}

}  // namespace vsplat
