#include "model/diagnose/selftest/reference/activation.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/reference/gemm.h"
#include "model/ops/dense/activation.h"
#include "runtime/gemm.h"

namespace vsplat::selftest {
namespace {

void activation_of(Checks& c, const std::vector<float>& x) {
  const auto dy = random_floats(x.size(), 2, 0.5f, 1.0f);
  for (const int act : {1, 2, 3, 4}) {
    const Shape shape{static_cast<long>(x.size())};
    std::vector<double> y, dx;
    for (std::size_t i = 0; i < x.size(); ++i) {
      y.push_back(ref::activate(x[i], act));
      dx.push_back(dy[i] * ref::activation_slope(x[i], act));
    }
    const Tensor in = c.up(shape, x), out = c.gap(shape), back = c.gap(shape);
    activation_forward(c.ctx, {in, static_cast<Activation>(act), out});
    c.close("forward", out, y, 1e-6);
    activation_backward(c.ctx, {in, static_cast<Activation>(act), c.up(shape, dy), back});
    c.close("backward", back, dx, 1e-6);
    if (!c.all) continue;
    const Tensor there = c.up(shape, x), by = c.up(shape, dy);
    activation_forward(c.ctx, {there, static_cast<Activation>(act), there});
    c.equal("forward, in place", there, c.ctx.read<float>(out));
    activation_backward(c.ctx, {in, static_cast<Activation>(act), by, by});
    c.equal("backward, in place", by, c.ctx.read<float>(back));
  }
}

void activation_all(Checks& c) {
  for (const std::size_t n : c.some({1UL, 3UL, 15UL, 16UL, 17UL, 1023UL, 1025UL}, {7UL, 101UL, 1024UL, 3001UL})) {
    auto x = random_floats(n, 1, -5, 5);
    x[0] = 2;  // one slope of about 1, by which all are measured
    activation_of(c, x);
  }
  if (!c.all) return;
  std::vector<float> x(4000);  // over the range in which they are neither 0 nor x
  for (std::size_t i = 0; i < x.size(); ++i) x[i] = -16.0f + 0.008f * static_cast<float>(i);
  activation_of(c, x);
}

}  // namespace

VSPLAT_CASES(activation, {"activation", activation_all})

}  // namespace vsplat::selftest
