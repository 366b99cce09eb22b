#include "model/ops/dense/gather.h"

#include <algorithm>

#include "model/diagnose/selftest/cases/cases.h"

namespace vsplat::selftest {
namespace {

void gather_all(Checks& c) {
  const std::vector<int> index = {4, 0, 6, 1, 5, 20, 18, 19};  // divided by 3, row 6 is three entries
  for (const long width : c.some({1L, 3L, 16L, 33L, 65L})) {
    const std::size_t w = size_of(width), wide = w + 3;
    const auto x = random_floats(7 * w, 1);
    for (const long shared : {1L, 3L}) {
      std::vector<int> rows = index;
      if (shared == 1) rows.resize(5);
      if (shared > 1) std::sort(rows.begin(), rows.end());
      const long p = static_cast<long>(rows.size());
      std::vector<float> want(rows.size() * wide, 9.0f);
      const auto row = [&](std::size_t i) { return static_cast<std::size_t>(rows[i]) / size_of(shared); };
      for (std::size_t i = 0; i < rows.size() * w; ++i) want[i / w * wide + 2 + i % w] = x[row(i / w) * w + i % w];
      const Tensor out = c.up({p, width + 3}, std::vector<float>(want.size(), 9.0f));
      gather_forward(c.ctx, {c.up({7, width}, x), c.up({p}, rows), out, 2, shared});
      c.equal("rows", out, want);
      const auto dout = random_floats(want.size(), 2), before = random_floats(7 * w, 3);
      std::vector<double> sums(before.begin(), before.end());
      for (std::size_t i = 0; i < rows.size() * w; ++i) sums[row(i / w) * w + i % w] += dout[i / w * wide + 2 + i % w];
      const Tensor dx = c.up({7, width}, before);
      gather_backward(c.ctx, {c.up({p, width + 3}, dout), c.up({p}, rows), dx, 2, shared});
      c.close("rows, backward", dx, sums, 1e-6);
    }
  }
  const std::vector<int> x = {5, -1, 1 << 30, 7}, at = {2, 0, 0, 3, 1};
  c.equal("integers", gather_integers(c.ctx, c.up({4}, x), c.up({5}, at)), std::vector<int>{1 << 30, 5, 5, 7, -1});
}

}  // namespace

VSPLAT_CASES(gather, {"gather", gather_all})

}  // namespace vsplat::selftest
