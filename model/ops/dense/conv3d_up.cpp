#include "model/ops/dense/conv3d_up.h"

#include <algorithm>

#include "runtime/blocks.h"
#include "runtime/column_sum.h"
#include "runtime/compose_rows.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// Numbers of the products that are in memory at a time.
constexpr long kFloats = 5 << 20;

long block_of(long voxels, long cout) { return std::min(voxels, std::max(64L, kFloats / (8 * cout))); }

Range rows_of(const Context& ctx, long n) {
  return ctx.flavour() == Flavour::cpu ? groups(1, 1, 8 * n) : groups(1, 32, 8 * n);
}

Cost cost_of(long n, long cout) { return {0, 64.0 * static_cast<double>(n) * static_cast<double>(cout)}; }

}  // namespace

PackedMatrix pack_conv3d_up(Context& ctx, const float* w, long cin, long cout, const std::string& what) {
  return pack_matrix(ctx, w, cin, 8 * cout, 8 * cout, 1, what);
}

PackedMatrix pack_conv3d_up(Context& ctx, const Tensor& w, const std::string& what) {
  Dims d;
  d.bind("w", w, {"Cin", "Cout", "2", "2", "2"});
  return pack_matrix(ctx, w, d["Cin"], 8 * d["Cout"], 8 * d["Cout"], 1, what);
}

void conv3d_up_forward(Context& ctx, const Conv3dUpForward& a) {
  Dims d;
  d.set("XYZ", a.x * a.y * a.z).set("corners", 8 * a.x * a.y * a.z).set("Cin", a.weights->k);
  d.bind("in", a.in, {"XYZ", "Cin"}).bind("out", a.out, {"corners", "Cout"}).bind_optional("bias", a.bias, {"Cout"});
  const long cout = d["Cout"], voxels = d["XYZ"], block = block_of(voxels, cout);
  if (a.weights->n != 8 * cout)
    fail(Status::internal, "conv3d_up: weights of {} columns, {} channels expected", a.weights->n, cout);
  const Tensor parts = ctx.tensor({block, 8 * cout}, Type::f32, "conv3d_up.parts");
  for (const long first : block_starts(ctx, voxels, block)) {
    const long n = std::min(block, voxels - first);
    Gemm g;
    g.a.x0 = a.in;
    g.b = a.weights;
    g.out = parts;
    g.row0 = first;
    g.rows = n;
    g.out_row0 = 0;
    g.name = a.name;
    gemm(ctx, g);
    const bool last = first + n == voxels;  // the rows of some voxels are not one run
    ctx.launch({"conv3d_up", "conv3d_up_forward", ""}, rows_of(ctx, n), cost_of(n, cout), parts, a.bias,
               last ? written(a.out) : written_somewhere(a.out), first, n, a.y, a.z, cout);
  }
}

void conv3d_up_backward(Context& ctx, const Conv3dUpBackward& a) {
  Dims d;
  d.set("XYZ", a.x * a.y * a.z).set("corners", 8 * a.x * a.y * a.z);
  d.bind("in", a.in, {"XYZ", "Cin"}).bind("dx", a.dx, {"XYZ", "Cin"}).bind("dy", a.dy, {"corners", "Cout"});
  d.bind("w", a.w, {"Cin", "Cout", "2", "2", "2"}).bind("dw", a.dw, {"Cin", "Cout", "2", "2", "2"});
  d.bind_optional("dbias", a.dbias, {"Cout"});
  const long cin = d["Cin"], cout = d["Cout"], voxels = d["XYZ"], block = block_of(voxels, cout);
  if (a.dbias) column_sum(ctx, {a.dy, a.dbias, true});
  const PackedMatrix back = pack_matrix(ctx, a.w, 8 * cout, cin, 1, 8 * cout, a.name);
  const Tensor all_parts = ctx.tensor({block, 8 * cout}, Type::f32, "conv3d_up.dparts");
  const Tensor all_rows = ctx.tensor({block, cin}, Type::f32, "conv3d_up.rows");
  for (const long first : block_starts(ctx, voxels, block)) {
    const long n = std::min(block, voxels - first);
    const Tensor parts = all_parts.first(n), rows = all_rows.first(n);
    ctx.launch({"conv3d_up", "conv3d_up_backward", ""}, rows_of(ctx, n), cost_of(n, cout), a.dy, written(parts), first,
               n, a.y, a.z, cout);
    RowSource source;
    source.x0 = a.in;
    compose_rows(ctx, source, rows, first);
    transposed_gemm(ctx, {rows, parts, a.dw.reshaped({cin, 8 * cout}), true, a.name});
    Gemm g;
    g.a.x0 = parts;
    g.b = &back;
    g.out = a.dx;
    g.rows = n;
    g.out_row0 = first;
    g.name = a.name;
    gemm(ctx, g);
  }
}

}  // namespace vsplat
