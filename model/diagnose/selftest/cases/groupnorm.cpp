#include "model/diagnose/selftest/reference/groupnorm.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/dense/groupnorm.h"

namespace vsplat::selftest {
namespace {

struct GroupNormTry {
  long n, c0, c1;
  int groups;
};

void groupnorm_of(Checks& c, const GroupNormTry& t, const std::vector<float>& x, const std::vector<float>& gamma,
                  const std::vector<float>& beta, double there = 1e-5) {
  const auto [n, c0, c1, groups] = t;
  const std::size_t channels = size_of(c0 + c1), rows = size_of(n), first = size_of(c0);
  const auto dy = random_floats(x.size(), 4), before = random_floats(channels, 7);
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
  c.close("forward", y, ref::groupnorm(x, rows, channels, static_cast<std::size_t>(groups), gamma, beta, 1e-6), there);
  if (there > 1e-5) return;
  c.keep();  // means and deviations
  // The gradient of two numbers is rounding alone: all of it is along their mean and their difference.
  if (n > 0 && n * ch / groups <= 2) return;
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
  if (!c.all) return;
  // Added to what is there, or in place of dy.
  const auto dx0 = random_floats(size_of(n, c0), 8), dx1 = random_floats(size_of(n, c1), 9);
  GroupNormBackward more = b;
  if (c1 > 0) {
    more.add = true, more.dx0 = c.up({n, c0}, dx0), more.dx1 = c.up({n, c1}, dx1);
    groupnorm_backward(c.ctx, more);
    c.close("backward, dx0, added", more.dx0, plus(part(want.dx, false), dx0), 1e-5);
    c.close("backward, dx1, added", more.dx1, plus(part(want.dx, true), dx1), 1e-5);
  } else {
    more.dx0 = more.dy = c.up({n, ch}, dy), more.dgamma = c.up({ch}, before), more.dbeta = c.up({ch}, before);
    groupnorm_backward(c.ctx, more);
    c.equal("backward, dgamma, in place", more.dgamma, c.ctx.read<float>(b.dgamma));
    c.equal("backward, dbeta, in place", more.dbeta, c.ctx.read<float>(b.dbeta));
    c.equal("backward, in place", more.dx0, c.ctx.read<float>(b.dx0));
  }
}

void groupnorm_of(Checks& c, const GroupNormTry& t) {
  const std::size_t channels = size_of(t.c0 + t.c1);
  auto gamma = random_floats(channels, 5, 0.5f, 1.5f);
  if (c.all) gamma[0] = 0;  // the scale says nothing about the variance there
  groupnorm_of(c, t, random_floats(size_of(t.n) * channels, 3, -2, 3), gamma, random_floats(channels, 6));
}

void groupnorm_all(Checks& c) {
  for (const GroupNormTry& t : c.some({GroupNormTry{3, 4, 0, 2},
                                       {7, 3, 3, 2},
                                       {63, 16, 0, 4},
                                       {64, 20, 40, 4},
                                       {65, 23, 1, 3},
                                       {101, 33, 0, 1},
                                       {1025, 12, 0, 6},
                                       {4099, 5, 3, 2}},
                                      {{40000, 5, 0, 5},
                                       {40000, 5, 0, 1},
                                       {50, 23, 1, 3},
                                       {700, 20, 40, 4},
                                       {1, 20, 40, 4},
                                       {1, 23, 1, 3},
                                       {0, 4, 0, 2},
                                       {37, 20, 4, 4},
                                       {999, 33, 0, 3}}))
    groupnorm_of(c, t);
  if (!c.all) return;
  for (const long n : {1L, 3L, 7L, 8L, 9L, 31L, 33L, 101L, 517L})
    for (const auto& [channels, groups] : {std::pair{1L, 1}, {6L, 1}, {6L, 3}, {16L, 4}, {17L, 1}, {66L, 11}})
      groupnorm_of(c, {n, channels, 0, groups});
  // Means far from zero with small variances: float32 itself keeps x to 300 * 6e-8 of the deviation; the sum of squares
  // minus the squared sum would lose 300^2 times as much. Then a first row, from which a shift would be taken, that is
  // nothing like the others; channels of a group differ, too.
  const auto gamma = random_floats(12, 5, 0.5f, 1.5f), beta = random_floats(12, 6);
  for (const long n : {5L, 300L, 5000L}) {
    auto x = random_floats(size_of(n, 12), 11, -0.01f, 0.01f);
    for (float& v : x) v += 3;
    groupnorm_of(c, {n, 12, 0, 3}, x, gamma, beta, 1e-4);
  }
  auto x = random_floats(3000 * 8, 12, -0.1f, 0.1f);
  for (std::size_t i = 8; i < x.size(); ++i) x[i] += 5 + 0.5f * static_cast<float>(i % 8);
  groupnorm_of(c, {3000, 8, 0, 2}, x, random_floats(8, 5, 0.5f, 1.5f), random_floats(8, 6), 1e-4);
  // Where SiLU's exponential is beyond what floats hold.
  std::vector<float> far(18, 300);
  for (std::size_t i = 1; i < far.size(); i += 2) far[i] = -300;
  groupnorm_of(c, {50, 18, 0, 2}, random_floats(50 * 18, 31, -1, 2), std::vector<float>(18, 100), far);
}

}  // namespace

VSPLAT_CASES(groupnorm, {"groupnorm", groupnorm_all})

}  // namespace vsplat::selftest
