#include "runtime/column_sum.h"

#include "model/diagnose/selftest/cases/cases.h"

namespace vsplat::selftest {
namespace {

void column_sum_all(Checks& c) {
  for (const long rows : c.some({1L, 3L, 63L, 64L, 65L, 1009L, 4097L}))
    for (const long channels : {1L, 17L, 64L}) {
      const auto x = random_floats(size_of(rows, channels), 1), before = random_floats(size_of(channels, 1), 2);
      std::vector<double> want(before.begin(), before.end());
      for (std::size_t i = 0; i < x.size(); ++i) want[i % size_of(channels, 1)] += x[i];
      const Tensor out = c.up({channels}, before);
      column_sum(c.ctx, {c.up({rows, channels}, x), out, true});
      c.close("sums", out, want, 1e-6);
    }
}

}  // namespace

VSPLAT_CASES(column_sum, {"column_sum", column_sum_all})

}  // namespace vsplat::selftest
