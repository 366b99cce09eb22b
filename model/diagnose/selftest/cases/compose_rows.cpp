#include "runtime/compose_rows.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/products.h"
#include "model/diagnose/selftest/reference/gemm.h"
#include "runtime/gemm.h"

namespace vsplat::selftest {
namespace {

// Rows of a larger matrix of `t`, from row0 on.
void compose_rows_of(Checks& c, const ProductTry& t, long row0, long rows) {
  const ref::GemmCase g = gemm_case(t);
  RowSource in = upload_rows(c.ctx, g.a);
  if (!g.map.empty()) in.map = c.up({t.m, t.taps}, g.map);
  const Tensor out = c.gap({rows, g.k});
  compose_rows(c.ctx, in, out, row0);
  std::vector<double> want;
  for (long row = row0; row < row0 + rows; ++row)
    for (long tap = 0; tap < g.taps; ++tap)
      for (long ch = 0; ch < t.k; ++ch)
        want.push_back(g.a.at(g.map.empty() ? row : g.map[size_of(row * g.taps + tap)], ch));
  c.close("rows", out, want, 1e-6);
}

void compose_rows_all(Checks& c) {
  for (const long m : c.some({1L, 7L, 64L, 101L})) compose_rows_of(c, {m, 1, 12, 5, true, 3}, 0, m);
  if (!c.all) return;
  compose_rows_of(c, {0, 1, 5}, 0, 0);
  for (const long c0 : {1L, 7L, 16L, 17L, 33L})
    for (const long c1 : {0L, 1L, 16L, 19L}) {
      compose_rows_of(c, {11, 1, c0 + c1, c1}, 0, 11);
      compose_rows_of(c, {11, 1, c0 + c1, c1, true}, 4, 5);
      compose_rows_of(c, {11, 1, c0 + c1, c1, false, 0, 0, false, false, true}, 10, 1);
      compose_rows_of(c, {13, 1, c0 + c1, c1, true, 8}, 0, 13);
      compose_rows_of(c, {9, 1, c0 + c1, c1, true, 27, 0, false, false, false}, 3, 6);
    }
}

}  // namespace

VSPLAT_CASES(compose_rows, {"compose_rows", compose_rows_all})

}  // namespace vsplat::selftest
