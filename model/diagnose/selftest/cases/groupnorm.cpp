#include "model/diagnose/selftest/reference/groupnorm.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/dense/groupnorm.h"

namespace vsplat::selftest {
namespace {

void groupnorm_of(Checks& c, long n, long c0, long c1, int groups) {
  const std::size_t channels = size_of(c0 + c1), rows = size_of(n), first = size_of(c0);
  const auto x = random_floats(rows * channels, 3, -2, 3), dy = random_floats(rows * channels, 4),
             beta = random_floats(channels, 6), before = random_floats(channels, 7);
  auto gamma = random_floats(channels, 5, 0.5f, 1.5f);
  if (c.all) gamma[0] = 0;  // the scale says nothing about the variance there
  const auto part = [&](const auto& of, bool second) {
    auto out = of;
    out.clear();
    for (std::size_t i = 0; i < of.size(); ++i)
      if ((i % channels >= first) == second) out.push_back(of[i]);
    return out;
  };
  GroupNormForward f;
  const long ch = c0 + c1;
  f.x0 = c.up({n, c0}, part(x, false));
  if (c1 > 0) f.x1 = c.up({n, c1}, part(x, true));
  f.gamma = c.up({ch}, gamma), f.beta = c.up({ch}, beta), f.groups = groups;
  f.scale = c.gap({ch}), f.shift = c.gap({ch}), f.mean = c.gap({ch}), f.rstd = c.gap({ch});
  groupnorm_forward(c.ctx, f);
  const auto scale = c.ctx.read<float>(f.scale), shift = c.ctx.read<float>(f.shift);
  std::vector<float> y;
  for (std::size_t i = 0; i < x.size(); ++i) y.push_back(x[i] * scale[i % channels] + shift[i % channels]);
  c.close("forward", y, ref::groupnorm(x, rows, channels, static_cast<std::size_t>(groups), gamma, beta, 1e-6), 1e-5);
  c.keep();  // means and deviations
  // The gradient of two numbers is rounding alone: all of it is along their mean and their difference.
  if (n * ch / groups <= 2) return;
  const auto want = ref::groupnorm_backward(x, rows, channels, static_cast<std::size_t>(groups), gamma, beta, 1e-6, dy);
  GroupNormBackward b;
  b.x0 = f.x0, b.x1 = f.x1, b.gamma = f.gamma, b.groups = groups;
  b.scale = f.scale, b.shift = f.shift, b.mean = f.mean, b.rstd = f.rstd;
  b.dy = c.up({n, ch}, dy), b.dx0 = c.gap({n, c0});
  if (c1 > 0) b.dx1 = c.gap({n, c1});
  b.dgamma = c.up({ch}, before), b.dbeta = c.up({ch}, before);
  groupnorm_backward(c.ctx, b);
  c.close("backward, dx0", b.dx0, part(want.dx, false), c.within(2e-5, 1e-5));
  if (c1 > 0) c.close("backward, dx1", b.dx1, part(want.dx, true), c.within(2e-5, 1e-5));
  c.close("backward, dgamma", b.dgamma, plus(want.dgamma, before), c.within(2e-5, 1e-5));
  c.close("backward, dbeta", b.dbeta, plus(want.dbeta, before), c.within(2e-5, 1e-5));
}

void groupnorm_all(Checks& c) {
  struct Try {
    long n, c0, c1;
    int groups;
  };
  for (const Try& t :
       c.some({Try{3, 4, 0, 2},
               {7, 3, 3, 2},
               {63, 16, 0, 4},
               {64, 20, 40, 4},
               {65, 23, 1, 3},
               {101, 33, 0, 1},
               {1025, 12, 0, 6},
               {4099, 5, 3, 2}},
              {{40000, 5, 0, 5}, {40000, 5, 0, 1}, {50, 23, 1, 3}, {700, 20, 40, 4}, {1, 20, 40, 4}, {1, 23, 1, 3}}))
    groupnorm_of(c, t.n, t.c0, t.c1, t.groups);
  if (!c.all) return;
  for (const long n : {1L, 3L, 7L, 8L, 9L, 31L, 33L, 101L, 517L})
    for (const auto& [channels, groups] : {std::pair{1L, 1}, {6L, 1}, {6L, 3}, {16L, 4}, {17L, 1}, {66L, 11}})
      groupnorm_of(c, n, channels, 0, groups);
}

}  // namespace

VSPLAT_CASES(groupnorm, {"groupnorm", groupnorm_all})

}  // namespace vsplat::selftest
