// Convolutions of volumes: dense, by Winograd's method, downwards, upwards, of voxels; and trilinear upsampling.
#include <algorithm>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/random_convolutions.h"
#include "model/diagnose/selftest/reference/conv3d_up.h"
#include "model/diagnose/selftest/reference/sparse_conv.h"
#include "model/diagnose/selftest/reference/sparse_map.h"
#include "model/diagnose/selftest/reference/upsample3d.h"
#include "model/ops/dense/conv3d_up.h"
#include "model/ops/volume/sparse_conv.h"
#include "model/ops/volume/sparse_map.h"
#include "model/ops/volume/upsample3d.h"

namespace vsplat::selftest {
namespace {

std::size_t conv_size(long a, long b = 1) { return static_cast<std::size_t>(a * b); }
const float* or_null(const std::vector<float>& v) { return v.empty() ? nullptr : v.data(); }

void conv3d_of(Checks& c, const ConvTry& t, ConvMethod method) {
  // Winograd's transforms triple the rounding of float32 sums.
  const double tolerance = method == ConvMethod::winograd ? 2e-5 : 1e-5;
  const ref::ConvCase want = make_conv_case(t);
  const long cin = t.cin + t.c1, rows = want.in.rows;
  const auto dy = random_floats(conv_size(rows, t.cout), 73), before = random_floats(want.w.size(), 74);
  const auto forward = [&](const ConvWeights& weights, const char* what) {
    Conv3dForward f;
    f.in = upload_rows(c.ctx, want.in), f.x = t.size[0], f.y = t.size[1], f.z = t.size[2], f.weights = &weights;
    if (t.residual) f.residual = c.up({rows, t.cout}, want.residual);
    f.out = c.gap({rows, t.cout});
    conv3d_forward(c.ctx, f);
    c.close(
        what, f.out, [&] { return want.all(); }, tolerance);
  };
  forward(pack_conv3d(c.ctx, want.w.data(), or_null(want.bias), t.cout, cin, "weight", method), "forward");
  const Tensor w = c.up({t.cout, cin, 3, 3, 3}, want.w);
  const Tensor bias = t.bias ? c.up({t.cout}, want.bias) : Tensor();
  const ConvWeights packed = pack_conv3d(c.ctx, w, bias, "weight", method);
  c.close("packed on the device", packed.w.data,
          c.ctx.read<float>(pack_conv3d(c.ctx, want.w.data(), nullptr, t.cout, cin, "weight", method).w.data), 1e-6);
  c.keep();
  forward(packed, "forward, packed on the device");
  const ref::ConvGradient by = ref::conv_backward(want, dy);
  // By weights Winograd's method is the cpu flavour's.
  const ConvMethod by_weights = c.ctx.flavour() == Flavour::cpu ? method : ConvMethod::direct;
  Conv3dBackwardWeights g;
  g.in = upload_rows(c.ctx, want.in), g.x = t.size[0], g.y = t.size[1], g.z = t.size[2], g.method = by_weights;
  g.dy = c.up({rows, t.cout}, dy), g.dw = c.up({t.cout, cin, 3, 3, 3}, before), g.dbias = c.zeros({t.cout});
  conv3d_backward_weights(c.ctx, g);
  auto sums = by.dw;
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += before[i];
  c.close("backward, dw", g.dw, sums, tolerance);
  c.close("backward, dbias", g.dbias, by.dbias, 1e-5);
  Conv3dBackwardInputs b;
  b.w = w, b.x = t.size[0], b.y = t.size[1], b.z = t.size[2], b.method = method;
  b.dy = g.dy, b.dx = c.gap({rows, cin});
  conv3d_backward_inputs(c.ctx, b);
  c.close("backward, dx", b.dx, by.dx, tolerance);
}

void conv3d_by(Checks& c, ConvMethod method) {
  for (const ConvTry& t : c.some({ConvTry{{1, 1, 1}, 1, 1},
                                  {{3, 2, 11}, 3, 5},
                                  {{2, 3, 12}, 7, 31},
                                  {{1, 5, 13}, 16, 32},
                                  {{3, 3, 5}, 17, 33},
                                  {{7, 4, 2}, 33, 16},
                                  {{5, 5, 4}, 12, 65}}))
    conv3d_of(c, t, method);
  ConvTry all{{4, 3, 13}, 16, 20, 5};
  all.affine = all.silu = all.residual = true;
  conv3d_of(c, all, method);
}

void conv3d_all(Checks& c) {
  conv3d_by(c, ConvMethod::direct);
  // Enough tiles of 128 x 128 for the gpu flavour to take those.
  if (c.ctx.flavour() == Flavour::gpu)
    conv3d_of(c, {{2L * c.ctx.device().compute_units + 1, 8, 16}, 2, 66}, ConvMethod::direct);
}

void conv3d_winograd_all(Checks& c) {
  if (!c.ctx.switched_off().winograd) conv3d_by(c, ConvMethod::winograd);
}

void conv3d_down_all(Checks& c) {
  for (const auto& size : c.some({std::array<long, 3>{2, 2, 2}, {4, 6, 8}, {5, 3, 7}})) {
    ConvTry t{size, 17, 33};
    t.affine = t.silu = true;
    const ref::ConvCase want = make_conv_case(t, 2);
    const auto out = want.out_size();
    const long rows = out[0] * out[1] * out[2];
    const Tensor w = c.up({33, 17, 2, 2, 2}, want.w), bias = c.up({33}, want.bias);
    Conv3dDownForward f;
    f.in = upload_rows(c.ctx, want.in), f.in.map = conv3d_down_map(c.ctx, size[0], size[1], size[2]);
    for (const bool on_host : {true, false}) {
      const ConvWeights weights = on_host ? pack_conv3d_down(c.ctx, want.w.data(), want.bias.data(), 33, 17, "weight")
                                          : pack_conv3d_down(c.ctx, w, bias, "weight");
      f.weights = &weights, f.out = c.gap({rows, 33});
      conv3d_down_forward(c.ctx, f);
      c.close(
          "forward", f.out, [&] { return want.all(); }, 1e-5);
    }
    const auto dy = random_floats(conv_size(rows, 33), 75);
    const ref::ConvGradient by = ref::conv_backward(want, dy);
    const Conv3dDownBackward g{
        f.in, w, c.up({rows, 33}, dy), c.zeros({want.in.rows, 17}), c.zeros({33, 17, 2, 2, 2}), c.zeros({33})};
    conv3d_down_backward(c.ctx, g);
    c.close("backward, dx", g.dx, by.dx, 1e-5);
    c.close("backward, dw", g.dw, by.dw, 1e-5);
    c.close("backward, dbias", g.dbias, by.dbias, 1e-5);
  }
}

void conv3d_up_all(Checks& c) {
  struct Try {
    long x, y, z, cin, cout;
  };
  for (const Try& t : c.some({Try{1, 1, 1, 1, 1}, {2, 3, 5, 7, 3}, {3, 1, 2, 16, 12}, {5, 5, 5, 33, 17}})) {
    const long n = t.x * t.y * t.z;
    ref::Conv3dUpCase want;
    want.x = conv_size(t.x), want.y = conv_size(t.y), want.z = conv_size(t.z), want.cin = conv_size(t.cin),
    want.cout = conv_size(t.cout);
    want.in = random_floats(conv_size(n, t.cin), 1), want.w = random_floats(conv_size(8 * t.cin, t.cout), 2);
    want.bias = random_floats(conv_size(t.cout), 3);
    const Tensor w = c.up({t.cin, t.cout, 2, 2, 2}, want.w);
    Conv3dUpForward f;
    f.in = c.up({n, t.cin}, want.in), f.x = t.x, f.y = t.y, f.z = t.z, f.bias = c.up({t.cout}, want.bias);
    for (const bool on_host : {true, false}) {
      const PackedMatrix packed =
          on_host ? pack_conv3d_up(c.ctx, want.w.data(), t.cin, t.cout, "w") : pack_conv3d_up(c.ctx, w, "w");
      f.weights = &packed, f.out = c.gap({8 * n, t.cout});
      conv3d_up_forward(c.ctx, f);
      c.close(
          "forward", f.out, [&] { return want.forward(); }, 1e-5);
    }
    const auto dy = random_floats(conv_size(8 * n, t.cout), 4);
    const auto by = want.backward(dy);
    Conv3dUpBackward b;
    b.in = f.in, b.x = t.x, b.y = t.y, b.z = t.z, b.w = w, b.dy = c.up({8 * n, t.cout}, dy);
    b.dx = c.gap({n, t.cin}), b.dw = c.zeros(w.shape()), b.dbias = c.zeros({t.cout});
    conv3d_up_backward(c.ctx, b);
    c.close("backward, dx", b.dx, by.in, 1e-5);
    c.close("backward, dw", b.dw, by.w, 1e-5);
    c.close("backward, dbias", b.dbias, by.bias, 1e-5);
  }
}

std::vector<int> some_voxels(int r, float share) {
  const auto lot = random_floats(conv_size(r * r, r), 1, 0, 1);
  std::vector<int> out;
  for (std::size_t v = 0; v < lot.size(); ++v)
    if (lot[v] < share || v == 0) out.push_back(static_cast<int>(v));
  std::shuffle(out.begin(), out.end(), std::mt19937(2));
  return out;
}

void sparse_map_all(Checks& c) {
  for (const int r : c.some({1, 3, 5, 9})) {
    const auto voxels = some_voxels(r, 0.3f);
    const long p = static_cast<long>(voxels.size());
    const Tensor map = c.up({p, 27}, std::vector<int>(voxels.size() * 27, -7));
    sparse_map_forward(c.ctx, {c.up({p}, voxels), r, map});
    c.equal("map", map, ref::sparse_map(voxels, r));
  }
}

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
    want.in.x0 = random_floats(conv_size(p, t.c0), 3), want.in.x1 = random_floats(conv_size(p, t.c1), 4);
    want.in.scale = random_floats(conv_size(cin), 5, 0.5f, 2.0f), want.in.shift = random_floats(conv_size(cin), 6);
    want.w = random_floats(conv_size(t.cout * cin, want.taps()), 7), want.bias = random_floats(conv_size(t.cout), 8);
    const auto dy = random_floats(conv_size(p, t.cout), 9);
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

void upsample3d_all(Checks& c) {
  struct Try {
    long d, h, w, channels;
  };
  for (const Try& t : c.some({Try{1, 1, 1, 3}, {3, 2, 1, 7}, {2, 3, 4, 16}, {3, 3, 3, 17}, {2, 5, 3, 33}})) {
    const long n = t.d * t.h * t.w;
    const auto x = random_floats(conv_size(n, t.channels), 1), dy = random_floats(conv_size(8 * n, t.channels), 2);
    const Tensor y = c.gap({8 * n, t.channels}), dx = c.gap({n, t.channels});
    upsample3d_forward(c.ctx, {c.up({n, t.channels}, x), t.d, t.h, t.w, y});
    c.close("forward", y, ref::upsample3d(x, t.d, t.h, t.w, t.channels), 1e-6);
    upsample3d_backward(c.ctx, {c.up({8 * n, t.channels}, dy), t.d, t.h, t.w, dx, false});
    c.close(
        "backward", dx, [&] { return ref::upsample3d_backward(dy, t.d, t.h, t.w, t.channels); }, 1e-6);
  }
}

}  // namespace

std::vector<Case> convolution_cases() {
  return {{"conv3d", conv3d_all},        {"conv3d_winograd", conv3d_winograd_all}, {"conv3d_down", conv3d_down_all},
          {"conv3d_up", conv3d_up_all},  {"sparse_map", sparse_map_all},           {"sparse_conv", sparse_conv_all},
          {"upsample3d", upsample3d_all}};
}

}  // namespace vsplat::selftest
