#include "model/diagnose/selftest/reference/top_k.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/volume/top_k.h"

namespace vsplat::selftest {
namespace {

void top_k_all(Checks& c) {
  for (const long n : c.some({1L, 7L, 63L, 65L, 1009L}, {0L, 3L, 64L, 1021L, 5000L})) {
    auto x = random_floats(size_of(n), 1);
    for (std::size_t i = 0; i < x.size(); i += 3) x[i] = 0.25f;  // equal ones, too
    for (const long k : c.some({1L, n / 3, n}, {0L, n + 5})) {
      const Tensor flags = c.up({n}, std::vector<std::uint32_t>(x.size(), 7)),
                   others = c.up({n}, std::vector<std::uint32_t>(x.size(), 7));
      top_k(c.ctx, {c.up({n}, x), k, flags, others});
      const auto want = ref::top_k(x, size_of(k));
      c.equal("largest", flags, want);
      auto rest = want;
      for (auto& v : rest) v = 1 - v;
      c.equal("others", others, rest);
      if (!c.all) continue;
      top_k(c.ctx, {c.up({n}, x), k, others, {}});
      c.equal("largest alone", others, want);
    }
  }
}

}  // namespace

VSPLAT_CASES(top_k, {"top_k", top_k_all})

}  // namespace vsplat::selftest
