#include "model/ops/dense/gather.h"

#include "model/diagnose/selftest/cases/cases.h"

namespace vsplat::selftest {
namespace {

// Rows of x [7, width], so many indices for one, to columns 2 on of wider rows, or to the rows from row0 on of a longer
// matrix; and back.
void gather_of(Checks& c, long width, const std::vector<int>& index, long shared, long row0 = -1) {
  const long p = static_cast<long>(index.size()), rows = row0 < 0 ? p : row0 + p + 2, column = row0 < 0 ? 2 : 0,
             out_width = row0 < 0 ? width + 3 : width;
  const std::size_t w = size_of(width), wide = size_of(out_width), start = row0 < 0 ? 2 : size_of(row0, width);
  const auto row = [&](std::size_t i) { return static_cast<std::size_t>(index[i]) / size_of(shared); };
  const auto x = random_floats(7 * w, 1);
  std::vector<float> want(size_of(rows) * wide, 9.0f);
  for (std::size_t i = 0; i < index.size() * w; ++i) want[start + i / w * wide + i % w] = x[row(i / w) * w + i % w];
  const Tensor at = c.up({p}, index), out = c.up({rows, out_width}, std::vector<float>(want.size(), 9.0f));
  gather_forward(c.ctx, {c.up({7, width}, x), at, out, column, shared, row0});
  c.equal("rows", out, want);
  // Without the last entry, whose index is negative.
  std::vector<int> some = index;
  if (shared == 1) some.back() = -1;
  const auto dout = random_floats(want.size(), 2);
  auto sums = random_floats(7 * w, 3);
  const Tensor dx = c.up({7, width}, sums);
  std::vector<double> wide_sums(sums.begin(), sums.end());
  for (std::size_t i = 0; i < index.size() * w; ++i) {
    if (some[i / w] < 0) continue;
    const float by = dout[start + i / w * wide + i % w];
    sums[row(i / w) * w + i % w] += by, wide_sums[row(i / w) * w + i % w] += by;
  }
  gather_backward(c.ctx, {c.up({rows, out_width}, dout), c.up({p}, some), dx, column, shared, row0});
  if (shared == 1)  // each row has one source at most: one rounding
    c.equal("rows, backward", dx, sums);
  else
    c.close("rows, backward", dx, wide_sums, 1e-6);
}

void gather_all(Checks& c) {
  for (const long width : c.some({1L, 3L, 16L, 33L, 65L})) {
    gather_of(c, width, {4, 0, 6, 1, 5, 2}, 1);
    gather_of(c, width, {0, 1, 4, 5, 6, 18, 19, 20}, 3);  // row 6 is three entries
  }
  if (c.all) gather_of(c, 5, {4, 0, 6}, 1, 3), gather_of(c, 3, {}, 3, 1);
  const std::vector<int> x = {5, -1, 1 << 30, 7}, at = {2, 0, 0, 3, 1};
  c.equal("integers", gather_integers(c.ctx, c.up({4}, x), c.up({5}, at)), std::vector<int>{1 << 30, 5, 5, 7, -1});
}

}  // namespace

VSPLAT_CASES(gather, {"gather", gather_all})

}  // namespace vsplat::selftest
