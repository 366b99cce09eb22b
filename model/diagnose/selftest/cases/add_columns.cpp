#include "model/ops/dense/add_columns.h"

#include "model/diagnose/selftest/cases/cases.h"

namespace vsplat::selftest {
namespace {

// To columns with so many before and after them, from those behind `skipped` and before `left`. One rounding each: the
// bits are known.
void add_columns_of(Checks& c, long rows, long width, long before, long after, long skipped = 0, long left = 0) {
  const long wide = before + width + after, from = skipped + width + left;
  const auto x = random_floats(size_of(rows, from), 1);
  auto want = random_floats(size_of(rows, wide), 2);
  const Tensor out = c.up({rows, wide}, want);
  for (long i = 0; i < rows * width; ++i)
    want[size_of(i / width * wide + before + i % width)] += x[size_of(i / width * from + skipped + i % width)];
  add_columns(c.ctx, {c.up({rows, from}, x), out, before, skipped, left > 0 ? width : -1});
  c.equal("columns", out, want);
}

void add_columns_all(Checks& c) {
  for (const long width : c.some({1L, 7L, 16L, 33L})) add_columns_of(c, 13, width, 2, 3);
  if (!c.all) return;
  add_columns_of(c, 7, 3, 1, 0, 0, 2);
  add_columns_of(c, 7, 4, 1, 0, 2);
  add_columns_of(c, 7, 5, 1, 0, 33, 1);
  for (const long rows : {0L, 1L, 3L, 7L, 101L})
    for (const long width : {1L, 3L, 16L, 31L, 32L, 33L, 65L})
      for (const auto& [before, after] : {std::pair{0L, 0L}, {0L, 5L}, {width, 0L}, {2L, 3L}})
        add_columns_of(c, rows, width, before, after);
}

}  // namespace

VSPLAT_CASES(add_columns, {"add_columns", add_columns_all})

}  // namespace vsplat::selftest
