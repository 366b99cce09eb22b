// The convolution with a stride of 2, by products of patches.
#include "model/ops/dense/conv3d.h"
#include "model/ops/dense/gather.h"
#include "runtime/column_sum.h"
#include "runtime/compose_rows.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// w [Cout, Cin, 2, 2, 2] as rows of the patches that conv3d_down_forward() multiplies: [Cout, 8 Cin].
Tensor patch_order(Context& ctx, const Tensor& w, const std::string& what) {
  if (w.rank() != 5 || w.count() != w.dim(0) * w.dim(1) * 8 || w.type() != Type::f32)
    fail(Status::internal, "{}: weights are {}, [Cout, Cin, 2, 2, 2] expected", what, w.describe());
  const Tensor out = ctx.tensor({w.dim(0), 8 * w.dim(1)}, Type::f32, what);
  ctx.launch({"conv3d_backward", "conv3d_down_order", ""}, items(w.count()), {0, 8.0 * static_cast<double>(w.count())},
             w, written(out), w.dim(1), w.dim(0));
  return out;
}

}  // namespace

ConvWeights pack_conv3d_down(Context& ctx, const Tensor& w, const Tensor& bias, const std::string& what) {
  const Tensor ordered = patch_order(ctx, w, what);
  ConvWeights out;
  out.cin = w.dim(1), out.cout = w.dim(0), out.bias = bias;
  out.w = pack_matrix(ctx, ordered, 8 * out.cin, out.cout, 1, 8 * out.cin, what);
  return out;
}

Tensor conv3d_down_map(Context& ctx, long x, long y, long z) {
  const long hx = x / 2, hy = y / 2, hz = z / 2;
  if (ctx.planning()) return ctx.tensor({hx * hy * hz, 8}, Type::i32, "map of a stride of 2");
  std::vector<int> map;
  map.reserve(static_cast<std::size_t>(hx * hy * hz * 8));
  for (long i = 0; i < hx * hy * hz; ++i)
    for (long t = 0; t < 8; ++t) {
      const long px = 2 * (i / (hy * hz)) + t / 4, py = 2 * (i / hz % hy) + t / 2 % 2, pz = 2 * (i % hz) + t % 2;
      map.push_back(static_cast<int>((px * y + py) * z + pz));
    }
  return ctx.upload({hx * hy * hz, 8}, map, Type::i32, "map of a stride of 2");
}

void conv3d_down_forward(Context& ctx, const Conv3dDownForward& c) {
  if (!c.weights || !c.in.map || c.in.map.dim(1) != 8)
    fail(Status::internal, "{}: weights and the map of conv3d_down_map() are needed", c.name);
  Gemm g;
  g.a = c.in;
  g.b = &c.weights->w;
  g.bias = c.weights->bias;
  g.out = c.out;
  g.name = c.name;
  gemm(ctx, g);
}

void conv3d_down_backward(Context& ctx, const Conv3dDownBackward& g) {
  const char* name = "conv3d_down_backward";
  Dims d;
  d.bind("w", g.w, {"Cout", "Cin", "2", "2", "2"}).bind("dw", g.dw, {"Cout", "Cin", "2", "2", "2"});
  d.bind("map", g.in.map, {"P", "8"}, Type::i32)
      .bind("dy", g.dy, {"P", "Cout"})
      .bind_optional("dbias", g.dbias, {"Cout"});
  d.bind("x0", g.in.x0, {"N", "C0"}).bind_optional("dx", g.dx, {"N", "Cin"});
  const long cin = d["Cin"], cout = d["Cout"], p = d["P"];
  if (g.dbias) column_sum(ctx, {g.dy, g.dbias, true});
  {
    const Tensor patches = ctx.tensor({p, 8 * cin}, Type::f32, "conv3d_down.patches");
    const Tensor dordered = ctx.tensor({cout, 8 * cin}, Type::f32, "conv3d_down.dw");
    compose_rows(ctx, g.in, patches);
    transposed_gemm(ctx, {g.dy, patches, dordered, false, "conv3d_down.dw"});
    ctx.launch({"conv3d_backward", "conv3d_down_backward_add", ""}, items(g.dw.count()),
               {static_cast<double>(g.dw.count()), 12.0 * static_cast<double>(g.dw.count())}, dordered, written(g.dw),
               cin, cout);
  }
  if (!g.dx) return;
  const PackedMatrix transposed = pack_matrix(ctx, patch_order(ctx, g.w, name), cout, 8 * cin, 8 * cin, 1, name);
  Gemm back;
  back.a.x0 = g.dy;
  back.b = &transposed;
  back.out = ctx.tensor({p, 8 * cin}, Type::f32, "conv3d_down.dpatches");
  back.name = "conv3d_down.dx";
  gemm(ctx, back);
  // No voxel is in two patches.
  gather_backward(ctx, {back.out.reshaped({8 * p, cin}), g.in.map.reshaped({8 * p}), g.dx});
}

}  // namespace vsplat
