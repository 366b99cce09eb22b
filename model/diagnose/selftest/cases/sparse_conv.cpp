#include "model/diagnose/selftest/reference/sparse_conv.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/convolutions.h"
#include "model/diagnose/selftest/inputs/voxels.h"
#include "model/diagnose/selftest/reference/gemm.h"
#include "model/ops/volume/sparse_conv.h"
#include "model/ops/volume/sparse_map.h"

namespace vsplat::selftest {
namespace {

void sparse_conv_all(Checks& c) {
  struct Try {
    int r;
    float share;
    long c0, c1, cout;
    int side;
  };
  for (const Try& t : c.some({Try{3, 0.5f, 1, 0, 1, 3},
                              {4, 0.6f, 5, 3, 7, 3},
                              {3, 0.5f, 12, 0, 33, 1},
                              {6, 0.3f, 16, 1, 32, 3},
                              {5, 0.4f, 33, 0, 65, 3}})) {
    ref::SparseConvCase want;
    want.side = t.side, want.r = t.r, want.cout = t.cout, want.voxel = some_voxels(t.r, t.share);
    const long p = static_cast<long>(want.voxel.size()), cin = t.c0 + t.c1, k = t.side;
    want.in.rows = p, want.in.c0 = t.c0, want.in.c1 = t.c1, want.in.silu = true;
    want.in.x0 = random_floats(size_of(p, t.c0), 3), want.in.x1 = random_floats(size_of(p, t.c1), 4);
    want.in.scale = random_floats(size_of(cin), 5, 0.5f, 2.0f), want.in.shift = random_floats(size_of(cin), 6);
    want.w = random_floats(size_of(t.cout * cin, want.taps()), 7), want.bias = random_floats(size_of(t.cout), 8);
    const auto dy = random_floats(size_of(p, t.cout), 9);
    SubmanifoldForward f;
    f.in = upload_rows(c.ctx, want.in);
    if (k == 3) {
      f.in.map = c.ctx.tensor({p, 27}, Type::i32);
      sparse_map_forward(c.ctx, {c.up({p}, want.voxel), t.r, f.in.map});
      c.keep();  // the map
    }
    const Tensor w = c.up({t.cout, k, k, k, cin}, want.w);
    for (const bool on_host : {true, false}) {
      const ConvWeights weights =
          on_host ? pack_submanifold(c.ctx, want.w.data(), want.bias.data(), t.cout, want.taps(), cin, "weight")
                  : pack_submanifold(c.ctx, w, c.up({t.cout}, want.bias), "weight");
      f.weights = &weights, f.out = c.gap({p, t.cout});
      submanifold_forward(c.ctx, f);
      c.close(
          "forward", f.out, [&] { return ref::sparse_conv(want); }, 1e-5);
    }
    SubmanifoldBackward b;
    b.in = f.in, b.w = w, b.dy = c.up({p, t.cout}, dy), b.dx = c.gap({p, cin});
    b.dw = c.zeros(w.shape()), b.dbias = c.zeros({t.cout});
    submanifold_backward(c.ctx, b);
    const auto by = ref::sparse_conv_backward(want, dy);
    c.close("backward, dx", b.dx, by.dx, 1e-5);
    c.close("backward, dw", b.dw, by.dw, 1e-5);
    c.close("backward, dbias", b.dbias, by.dbias, 1e-5);
  }
}

}  // namespace

VSPLAT_CASES(sparse_conv, {"sparse_conv", sparse_conv_all})

}  // namespace vsplat::selftest
