#include "runtime/column_sum.h"

#include "model/diagnose/selftest/cases/cases.h"

namespace vsplat::selftest {
namespace {

void column_sum_of(Checks& c, long rows, long channels, bool add, double tolerance) {
  const auto x = random_floats(size_of(rows, channels), 1), before = random_floats(size_of(channels), 2);
  std::vector<double> want(size_of(channels));
  if (add) want.assign(before.begin(), before.end());
  for (std::size_t i = 0; i < x.size(); ++i) want[i % size_of(channels)] += x[i];
  const Tensor out = add ? c.up({channels}, before) : c.gap({channels});
  column_sum(c.ctx, {c.up({rows, channels}, x), out, add});
  c.close("sums", out, want, tolerance);
}

void column_sum_all(Checks& c) {
  for (const long rows : c.some({1L, 3L, 63L, 64L, 65L, 1009L, 4097L}))
    for (const long channels : {1L, 17L, 64L}) column_sum_of(c, rows, channels, true, 1e-6);
  if (!c.all) return;
  for (const long rows : {0L, 1L, 3L, 63L, 64L, 65L, 4095L, 4096L, 4097L})
    for (const long channels : {1L, 3L, 7L, 63L, 64L, 65L})
      for (const bool add : {false, true}) column_sum_of(c, rows, channels, add, 2e-6);
}

}  // namespace

VSPLAT_CASES(column_sum, {"column_sum", column_sum_all})

}  // namespace vsplat::selftest
