#include "model/diagnose/selftest/reference/top_k.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/volume/top_k.h"

namespace vsplat::selftest {
namespace {

void top_k_of(Checks& c, const std::vector<float>& x, long k) {
  const long n = static_cast<long>(x.size());
  const Tensor flags = c.up({n}, std::vector<std::uint32_t>(x.size(), 7)),
               others = c.up({n}, std::vector<std::uint32_t>(x.size(), 7));
  top_k(c.ctx, {c.up({n}, x), k, flags, others});
  const auto want = ref::top_k(x, size_of(k));
  c.equal("largest", flags, want);
  auto rest = want;
  for (auto& v : rest) v = 1 - v;
  c.equal("others", others, rest);
  if (!c.all) return;
  top_k(c.ctx, {c.up({n}, x), k, others, {}});
  c.equal("largest alone", others, want);
}

void top_k_all(Checks& c) {
  for (const long n : c.some({1L, 7L, 63L, 65L, 1009L}, {0L, 3L, 64L, 1021L, 5000L})) {
    auto x = random_floats(size_of(n), 1);
    for (std::size_t i = 0; i < x.size(); i += 3) x[i] = 0.25f;  // equal ones, too
    for (const long k : c.some({1L, n / 3, n}, {0L, n + 5})) top_k_of(c, x, k);
  }
  if (!c.all) return;
  std::vector<float> few(500);  // of five different numbers
  for (std::size_t i = 0; i < few.size(); ++i) few[i] = static_cast<float>(i * 7 % 5) - 2;
  for (const long k : {1L, 99L, 100L, 101L, 250L, 499L}) top_k_of(c, few, k);
  for (const long k : {1L, 2L, 3L, 4L, 5L, 6L}) top_k_of(c, {-INFINITY, -3, -0.0f, 0, 1e-30f, 2, INFINITY, -1e30f}, k);
}

}  // namespace

VSPLAT_CASES(top_k, {"top_k", top_k_all})

}  // namespace vsplat::selftest
