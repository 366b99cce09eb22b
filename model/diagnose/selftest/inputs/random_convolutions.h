// Convolutions over volumes of random numbers.
#pragma once
#include "model/diagnose/selftest/inputs/random_values.h"
#include "model/diagnose/selftest/reference/conv3d.h"
#include "model/ops/dense/conv3d.h"

namespace vsplat::selftest {

struct ConvTry {
  std::array<long, 3> size;
  long cin, cout;
  long c1 = 0;
  bool affine = false, silu = false, bias = true, residual = false;
};

inline ref::ConvCase make_conv_case(const ConvTry& t, long side = 3, std::uint32_t seed = 1) {
  ref::ConvCase c;
  c.size = t.size, c.side = side, c.cout = t.cout;
  if (side == 2) c.stride = 2, c.padding = 0;
  const auto voxels = static_cast<std::size_t>(t.size[0] * t.size[1] * t.size[2]);
  const auto channels = static_cast<std::size_t>(t.cin + t.c1), outs = static_cast<std::size_t>(t.cout);
  c.in.rows = static_cast<long>(voxels), c.in.c0 = t.cin, c.in.c1 = t.c1, c.in.silu = t.silu;
  c.in.x0 = random_floats(voxels * static_cast<std::size_t>(t.cin), seed);
  c.in.x1 = random_floats(voxels * static_cast<std::size_t>(t.c1), seed + 1);
  if (t.affine) {
    c.in.scale = random_floats(channels, seed + 2, 0.5f, 2.0f);
    c.in.shift = random_floats(channels, seed + 3);
  }
  c.w = random_floats(outs * channels * static_cast<std::size_t>(side * side * side), seed + 4);
  if (t.bias) c.bias = random_floats(outs, seed + 5);
  const auto out = c.out_size();
  if (t.residual) c.residual = random_floats(static_cast<std::size_t>(out[0] * out[1] * out[2]) * outs, seed + 6);
  return c;
}

inline RowSource upload_rows(Context& ctx, const ref::Rows& in) {
  RowSource out;
  out.x0 = ctx.upload({in.rows, in.c0}, in.x0);
  if (in.c1) out.x1 = ctx.upload({in.rows, in.c1}, in.x1);
  if (!in.scale.empty()) {
    out.scale = ctx.upload({in.c0 + in.c1}, in.scale);
    out.shift = ctx.upload({in.c0 + in.c1}, in.shift);
  }
  out.silu = in.silu;
  return out;
}

}  // namespace vsplat::selftest
