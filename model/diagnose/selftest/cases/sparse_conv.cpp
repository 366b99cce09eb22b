#include "model/diagnose/selftest/reference/sparse_conv.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/random_convolutions.h"
#include "model/diagnose/selftest/inputs/voxels.h"
#include "model/diagnose/selftest/reference/gemm.h"
#include "model/ops/volume/sparse_conv.h"
#include "model/ops/volume/sparse_map.h"

namespace vsplat::selftest {
namespace {

struct SparseConvTry {
  int r;
  float share;  // of the voxels that are active
  long c0, c1, cout;
  int side;
  bool norm = true;  // a scale, a shift and SiLU
};

void sparse_conv_of(Checks& c, const SparseConvTry& t) {
  ref::SparseConvCase want;
  want.side = t.side, want.r = t.r, want.cout = t.cout, want.voxel = some_voxels(t.r, t.share);
  const long p = static_cast<long>(want.voxel.size()), cin = t.c0 + t.c1, k = t.side;
  want.in.rows = p, want.in.c0 = t.c0, want.in.c1 = t.c1, want.in.silu = t.norm;
  want.in.x0 = random_floats(size_of(p, t.c0), 3), want.in.x1 = random_floats(size_of(p, t.c1), 4);
  if (t.norm) {
    want.in.scale = random_floats(size_of(cin), 5, 0.5f, 2.0f);
    want.in.shift = random_floats(size_of(cin), 6);
  }
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
  const auto dw = random_floats(want.w.size(), 10), dbias = random_floats(want.bias.size(), 12);
  b.dw = c.up(w.shape(), dw), b.dbias = c.up({t.cout}, dbias);
  submanifold_backward(c.ctx, b);
  const auto by = ref::sparse_conv_backward(want, dy);
  c.close("backward, dx", b.dx, by.dx, 1e-5);
  c.close("backward, dw", b.dw, plus(by.dw, dw), 1e-5);
  c.close("backward, dbias", b.dbias, plus(by.dbias, dbias), 1e-5);
  if (!c.all) return;
  SubmanifoldBackward alone = b;
  alone.dx = {}, alone.dw = c.up(w.shape(), dw), alone.dbias = c.up({t.cout}, dbias);
  submanifold_backward(c.ctx, alone);
  c.equal("backward, dw without dx", alone.dw, c.ctx.read<float>(b.dw));
  c.equal("backward, dbias without dx", alone.dbias, c.ctx.read<float>(b.dbias));
  const auto dx = random_floats(by.dx.size(), 11);
  b.dx = c.up(b.dx.shape(), dx), b.add = true;
  submanifold_backward(c.ctx, b);
  c.close("backward, dx, added", b.dx, plus(by.dx, dx), 1e-5);
}

void sparse_conv_all(Checks& c) {
  for (const SparseConvTry& t : c.some({SparseConvTry{3, 0.5f, 1, 0, 1, 3},
                                        {4, 0.6f, 5, 3, 7, 3},
                                        {3, 0.5f, 12, 0, 33, 1},
                                        {6, 0.3f, 16, 1, 32, 3},
                                        {5, 0.4f, 33, 0, 65, 3}},
                                       {{4, 0.4f, 6, 5, 8, 1},
                                        {4, 0.4f, 33, 0, 13, 1, false},
                                        {4, 0.4f, 6, 5, 8, 3, false},
                                        {4, 0.4f, 6, 17, 8, 3},
                                        {1, 1.0f, 5, 0, 6, 3, false},
                                        {2, 1.0f, 5, 0, 6, 3, false},
                                        {4, 1.0f, 9, 0, 10, 3, false},
                                        {7, 0.3f, 5, 0, 6, 3, false}}))
    sparse_conv_of(c, t);
  if (!c.all) return;
  for (const long cin : {1L, 7L, 31L, 32L, 33L})
    for (const long cout : {1L, 11L, 12L, 13L, 33L}) sparse_conv_of(c, {3, 0.6f, cin, 0, cout, 3, false});
  // More rows than are gathered at a time: the cpu flavour's 1024, and 4096 of the gpu flavour's where they are wide.
  sparse_conv_of(c, {11, 0.9f, 40, 0, 3, 3, false});
  sparse_conv_of(c, {11, 0.9f, 40, 0, 5, 3});
  sparse_conv_of(c, {17, 0.9f, 140, 0, 1, 3, false});
}

}  // namespace

VSPLAT_CASES(sparse_conv, {"sparse_conv", sparse_conv_all})

}  // namespace vsplat::selftest
