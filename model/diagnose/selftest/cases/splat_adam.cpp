#include "model/diagnose/selftest/reference/splat_adam.h"

#include <cmath>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/fit/splat_adam.h"

namespace vsplat::selftest {
namespace {

// Some steps, at a rate so high that the rounding of the parameters hides nothing of them. `shape` is of one Gaussian's
// parameters.
void splat_adam_of(Checks& c, long n, Shape shape, SplatAdam a) {
  shape.insert(shape.begin(), n);
  std::size_t width = 1;
  for (std::size_t i = 1; i < shape.size(); ++i) width *= static_cast<std::size_t>(shape[i]);
  const std::size_t count = size_of(n) * width;
  const auto start = random_floats(count, 1);
  a.param = c.up(shape, start), a.m = c.zeros(shape), a.v = c.zeros(shape);
  const ref::SplatAdam want{a.rate,
                            a.rate_rest,
                            a.beta1,
                            a.beta2,
                            a.eps,
                            static_cast<double>(a.low),
                            static_cast<double>(a.high),
                            width,
                            a.head > 0 ? size_of(a.head) : width};
  auto param = as_doubles(start);
  std::vector<double> m(count), v(count);
  for (a.step = 1; a.step <= (c.all ? 5 : 3); ++a.step) {
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

SplatAdam with_rates(double rate, long head = 0, double rest = 0) {
  SplatAdam a;
  a.rate = rate, a.head = head, a.rate_rest = rest;
  return a;
}

void splat_adam_all(Checks& c) {
  SplatAdam limited = with_rates(0.1, 3, 0.02);
  limited.low = -0.9f, limited.high = 0.8f;
  for (const long n : c.some({1L, 3L, 7L, 63L, 64L, 65L, 1009L}))
    for (const long s : {1L, 4L}) splat_adam_of(c, n, {s, 3}, limited);
  if (!c.all) return;
  for (const long n : {0L, 1L, 3L, 7L, 63L, 64L, 65L, 1009L})
    for (const Shape& shape : {Shape{}, Shape{3}}) splat_adam_of(c, n, shape, with_rates(0.1));
  SplatAdam other = with_rates(0.1);
  other.beta1 = 0.8, other.beta2 = 0.9, other.eps = 1e-7;
  splat_adam_of(c, 65, {3}, other);
  // Spherical harmonics: the constant coefficient's three numbers, and the others, at a rate of their own or none.
  for (const long n : {1L, 7L, 64L, 1009L})
    for (const long s : {1L, 4L, 16L})
      for (const SplatAdam& a : {with_rates(0.1, 3, 0.02), with_rates(0.1, 3, 0), with_rates(0, 3, 0.1)})
        splat_adam_of(c, n, {s, 3}, a);
  splat_adam_of(c, 65, {5}, with_rates(0.1, 2, 0.3));
  limited = with_rates(0.1);
  limited.low = -0.5f, limited.high = 0.25f;
  splat_adam_of(c, 1009, {3}, limited);
  limited.low = -INFINITY;
  splat_adam_of(c, 65, {}, limited);
}

}  // namespace

VSPLAT_CASES(splat_adam, {"splat_adam", splat_adam_all})

}  // namespace vsplat::selftest
