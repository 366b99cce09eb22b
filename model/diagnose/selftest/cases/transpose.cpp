#include "model/ops/dense/transpose.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"

namespace vsplat::selftest {
namespace {

void transpose_all(Checks& c) {
  for (const auto& [a, b] : c.some({std::array<long, 2>{1, 1}, {3, 7}, {16, 15}, {17, 33}, {101, 64}},
                                   {{1, 7}, {3, 1}, {15, 17}, {16, 16}, {101, 5}, {0, 3}})) {
    const auto x = random_floats(size_of(a, b), 1), before = random_floats(size_of(a, b), 2);
    std::vector<float> want(x.size()), sum(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) {
      const std::size_t at = i % size_of(b, 1) * size_of(a, 1) + i / size_of(b, 1);
      want[at] = x[i], sum[at] = before[at] + x[i];
    }
    const Tensor in = c.up({a, b}, x), out = c.gap({b, a}), added = c.up({b, a}, before);
    transpose(c.ctx, {in, out});
    c.equal("columns", out, want);
    transpose(c.ctx, {in, added, true});
    c.equal("columns, added", added, sum);
  }
}

}  // namespace

VSPLAT_CASES(transpose, {"transpose", transpose_all})

}  // namespace vsplat::selftest
