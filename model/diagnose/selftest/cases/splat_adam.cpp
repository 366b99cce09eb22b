#include "model/diagnose/selftest/reference/splat_adam.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/fit/splat_adam.h"

namespace vsplat::selftest {
namespace {

void splat_adam_all(Checks& c) {
  for (const long n : c.some({1L, 3L, 7L, 63L, 64L, 65L, 1009L}))
    for (const long s : {1L, 4L}) {
      const std::size_t count = size_of(n, 3 * s);
      const Shape shape{n, s, 3};
      const auto start = random_floats(count, 1);
      SplatAdam a;
      a.param = c.up(shape, start), a.m = c.zeros(shape), a.v = c.zeros(shape);
      a.rate = 0.1, a.head = 3, a.rate_rest = 0.02, a.low = -0.9f, a.high = 0.8f;
      const ref::SplatAdam want{a.rate,
                                s > 1 ? a.rate_rest : a.rate,
                                a.beta1,
                                a.beta2,
                                a.eps,
                                static_cast<double>(a.low),
                                static_cast<double>(a.high),
                                size_of(3 * s),
                                3};
      auto param = as_doubles(start);
      std::vector<double> m(count), v(count);
      for (a.step = 1; a.step <= 3; ++a.step) {
        auto grad = random_floats(count, static_cast<std::uint32_t>(1 + a.step), -1e-6f, 1e-6f);
        for (std::size_t i = 0; i < count; i += 2) grad[i] *= 1e6f;  // over many magnitudes
        a.grad = c.up(shape, grad);
        splat_adam(c.ctx, a);
        ref::splat_adam(want, a.step, as_doubles(grad), param, m, v);
      }
      c.close("parameters", a.param, param, 2e-6);
      c.close("first moments", a.m, m, 1e-6);
      c.close("second moments", a.v, v, 1e-6);
      c.equal("gradients", a.grad, std::vector<float>(count, 0.0f));
    }
}

}  // namespace

VSPLAT_CASES(splat_adam, {"splat_adam", splat_adam_all})

}  // namespace vsplat::selftest
