#include "model/diagnose/selftest/reference/position_encoding.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/networks/position_encoding.h"

namespace vsplat::selftest {
namespace {

// With so many columns of other things before and behind.
void position_encoding_of(Checks& c, long p, long before, long behind) {
  const std::size_t wide = size_of(63 + before + behind), first = size_of(before);
  const auto points = random_floats(size_of(3 * p), 1, -0.6f, 0.6f), dout = random_floats(size_of(p, 63), 2),
             sums = random_floats(size_of(3 * p), 3);
  const auto rows = ref::position_encoding(points);
  std::vector<double> want(size_of(p) * wide, 5);
  auto dwide = nans(want.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    want[i / 63 * wide + first + i % 63] = rows[i], dwide[i / 63 * wide + first + i % 63] = dout[i];
  }
  const Shape shape{p, 63 + before + behind};
  const Tensor in = c.up({p, 3}, points), dpoints = c.up({p, 3}, sums),
               out = before + behind > 0 ? c.up(shape, std::vector<float>(want.size(), 5.0f)) : c.gap(shape);
  position_encoding_forward(c.ctx, {in, out, before});
  c.close("forward", out, want, before + behind > 0 ? 1e-7 : c.within(1e-6, 5e-7));  // of the largest, 5 or 1
  position_encoding_backward(c.ctx, {in, c.up(shape, dwide), dpoints, before});
  c.close("backward", dpoints, plus(ref::position_encoding_backward(points, dout), sums), 1e-6);
}

void position_encoding_all(Checks& c) {
  for (const long p : c.some({1L, 3L, 63L, 64L, 65L, 211L}, {0L, 15L, 16L, 17L, 101L}))
    position_encoding_of(c, p, 0, 0);
  if (!c.all) return;
  for (const long p : {0L, 1L, 15L, 16L, 17L, 101L}) position_encoding_of(c, p, 1, 0), position_encoding_of(c, p, 2, 3);
}

}  // namespace

VSPLAT_CASES(position_encoding, {"position_encoding", position_encoding_all})

}  // namespace vsplat::selftest
