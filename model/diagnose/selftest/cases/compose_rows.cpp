#include "runtime/compose_rows.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/products.h"
#include "model/diagnose/selftest/inputs/random_convolutions.h"
#include "model/diagnose/selftest/reference/gemm.h"
#include "runtime/gemm.h"

namespace vsplat::selftest {
namespace {

void compose_rows_all(Checks& c) {
  for (const long m : c.some({1L, 7L, 64L, 101L})) {
    const ref::GemmCase g = gemm_case({m, 1, 12, 5, true, true});
    RowSource rows = upload_rows(c.ctx, g.a);
    rows.map = c.up({m, 3}, g.map);
    const Tensor out = c.gap({m, 36});
    compose_rows(c.ctx, rows, out);
    std::vector<double> want;
    for (const int row : g.map)
      for (long ch = 0; ch < 12; ++ch) want.push_back(g.a.at(row, ch));
    c.close("rows", out, want, 1e-6);
  }
}

}  // namespace

VSPLAT_CASES(compose_rows, {"compose_rows", compose_rows_all})

}  // namespace vsplat::selftest
