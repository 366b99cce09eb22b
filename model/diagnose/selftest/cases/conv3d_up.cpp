#include "model/diagnose/selftest/reference/conv3d_up.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/dense/conv3d_up.h"
#include "runtime/gemm.h"

namespace vsplat::selftest {
namespace {

void conv3d_up_all(Checks& c) {
  struct Try {
    long x, y, z, cin, cout;
    bool biased = true;
  };
  for (const Try& t : c.some({Try{1, 1, 1, 1, 1}, {2, 3, 5, 7, 3}, {3, 1, 2, 16, 12}, {5, 5, 5, 33, 17}},
                             // More voxels than come at a time, of which the last are fewer.
                             {{3, 1, 2, 16, 12, false}, {3, 5, 7, 2, 9001}})) {
    const long n = t.x * t.y * t.z;
    ref::Conv3dUpCase want;
    want.x = size_of(t.x), want.y = size_of(t.y), want.z = size_of(t.z), want.cin = size_of(t.cin),
    want.cout = size_of(t.cout);
    want.in = random_floats(size_of(n, t.cin), 1), want.w = random_floats(size_of(8 * t.cin, t.cout), 2);
    if (t.biased) want.bias = random_floats(size_of(t.cout), 3);
    const Tensor w = c.up({t.cin, t.cout, 2, 2, 2}, want.w);
    Conv3dUpForward f;
    f.in = c.up({n, t.cin}, want.in), f.x = t.x, f.y = t.y, f.z = t.z;
    if (t.biased) f.bias = c.up({t.cout}, want.bias);
    for (const bool on_host : {true, false}) {
      const PackedMatrix packed =
          on_host ? pack_conv3d_up(c.ctx, want.w.data(), t.cin, t.cout, "w") : pack_conv3d_up(c.ctx, w, "w");
      f.weights = &packed, f.out = c.gap({8 * n, t.cout});
      conv3d_up_forward(c.ctx, f);
      c.close(
          "forward", f.out, [&] { return want.forward(); }, 1e-5);
    }
    const auto dy = random_floats(size_of(8 * n, t.cout), 4);
    const auto by = want.backward(dy);
    const auto dw = random_floats(want.w.size(), 5), dbias = random_floats(size_of(t.cout), 6);
    Conv3dUpBackward b;
    b.in = f.in, b.x = t.x, b.y = t.y, b.z = t.z, b.w = w, b.dy = c.up({8 * n, t.cout}, dy);
    b.dx = c.gap({n, t.cin}), b.dw = c.up(w.shape(), dw);
    if (t.biased) b.dbias = c.up({t.cout}, dbias);
    conv3d_up_backward(c.ctx, b);
    c.close("backward, dx", b.dx, by.in, 1e-5);
    c.close("backward, dw", b.dw, plus(by.w, dw), 1e-5);
    if (t.biased) c.close("backward, dbias", b.dbias, plus(by.bias, dbias), 1e-5);
  }
}

}  // namespace

VSPLAT_CASES(conv3d_up, {"conv3d_up", conv3d_up_all})

}  // namespace vsplat::selftest
