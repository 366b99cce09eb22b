#include "model/diagnose/selftest/reference/position_encoding.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/networks/position_encoding.h"

namespace vsplat::selftest {
namespace {

void position_encoding_all(Checks& c) {
  for (const long p : c.some({1L, 3L, 63L, 64L, 65L, 211L})) {
    const auto points = random_floats(size_of(3 * p), 1, -0.6f, 0.6f), dout = random_floats(size_of(p, 63), 2),
               before = random_floats(size_of(3 * p), 3);
    const Tensor in = c.up({p, 3}, points), out = c.gap({p, 63}), dpoints = c.up({p, 3}, before);
    position_encoding_forward(c.ctx, {in, out});
    c.close("forward", out, ref::position_encoding(points), 1e-6);
    position_encoding_backward(c.ctx, {in, c.up({p, 63}, dout), dpoints});
    c.close("backward", dpoints, plus(ref::position_encoding_backward(points, dout), before), 1e-6);
  }
}

}  // namespace

VSPLAT_CASES(position_encoding, {"position_encoding", position_encoding_all})

}  // namespace vsplat::selftest
