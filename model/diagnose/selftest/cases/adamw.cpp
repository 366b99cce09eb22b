#include "model/diagnose/selftest/reference/adamw.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/fit/adamw.h"

namespace vsplat::selftest {
namespace {

// A rate so high that the steps are as large as the weights: float's rounding of the weights hides nothing of them.
void adamw_all(Checks& c) {
  for (const long n : c.some({1L, 3L, 63L, 64L, 65L, 1009L}, {7L})) {
    const auto count = static_cast<std::size_t>(n);
    const auto start = random_floats(count, 1);
    AdamwStep a{c.up({n}, start), {}, c.zeros({n}), c.zeros({n}), c.up({2}, std::vector<float>{7.0f, 0.25f})};
    a.lr = 0.1, a.weight_decay = 0.5;
    auto param = as_doubles(start);
    std::vector<double> m(count), v(count);
    for (a.step = 1; a.step <= (c.all ? 5 : 3); ++a.step) {
      auto grad = random_floats(count, static_cast<std::uint32_t>(1 + a.step), -1e-6f, 1e-6f);
      for (std::size_t i = 0; i < count; i += 2) grad[i] *= 1e6f;  // over many magnitudes
      a.grad = c.up({n}, grad);
      adamw_step(c.ctx, a);
      auto clipped = as_doubles(grad);
      for (double& g : clipped) g *= 0.25;
      ref::adamw({a.lr, a.beta1, a.beta2, a.eps, a.weight_decay}, a.step, clipped, param, m, v);
    }
    c.close("weights", a.param, param, 1e-6);
    c.close("first moments", a.m, m, 1e-6);
    c.close("second moments", a.v, v, 1e-6);
    const auto before = random_floats(count, 7);
    const Tensor average = c.up({n}, before), weights = c.up({n}, start);
    average_step(c.ctx, average, weights, 0.875);
    std::vector<double> want;
    for (std::size_t i = 0; i < count; ++i) want.push_back(0.875 * before[i] + 0.125 * static_cast<double>(start[i]));
    c.close("moving average", average, want, 1e-6);
  }
  for (const std::size_t n : c.some({1UL, 3UL, 2047UL, 2048UL, 2049UL, 100003UL}, {0UL, 64UL, 4099UL})) {
    const std::vector<std::vector<float>> grads = {random_floats(5, 1), random_floats(n, 2),
                                                   random_floats(3, 3, -20, 20)};
    GradientClip a{{}, 1, 0.5f, c.gap({2})};
    for (const auto& grad : grads) a.grads.push_back(c.up({static_cast<long>(grad.size())}, grad));
    gradient_clip(c.ctx, a);
    const double norm = ref::norm(grads);
    c.close_by_column("norm and factor", c.ctx.read<float>(a.out), 2,
                      std::vector<double>{norm, ref::clip_factor(norm, static_cast<double>(0.5f))}, 1e-6);
  }
}

}  // namespace

VSPLAT_CASES(adamw, {"adamw", adamw_all})

}  // namespace vsplat::selftest
