#include "model/ops/dense/conv3d.h"

#include <memory>

#include "bench/bench.h"
#include "bench/case_data.h"
#include "bench/ops/operation.h"
#include "bench/references.h"
#include "bench/shapes.h"

namespace vsplat::bench {

namespace {

struct Data {
  ConvShape shape;
  std::vector<float> x0, x1, scale, shift, w, bias, residual;
  ConvWeights weights;
  Conv3dForward conv;

  long channels() const { return shape.cin + shape.c1; }

  double in(long voxel, long c) const {
    double v = c < shape.cin ? x0[static_cast<std::size_t>(voxel * shape.cin + c)]
                             : x1[static_cast<std::size_t>(voxel * shape.c1 + c - shape.cin)];
    if (!shape.prologue) return v;
    v = v * scale[static_cast<std::size_t>(c)] + shift[static_cast<std::size_t>(c)];
    return v / (1 + std::exp(-v));
  }

  double want(long i) const {
    const long n = i % shape.cout, voxel = i / shape.cout, side = shape.side;
    const long x = voxel / (side * side), y = voxel / side % side, z = voxel % side;
    double sum = bias[static_cast<std::size_t>(n)];
    for (long t = 0; t < 27; ++t) {
      const long px = x + t / 9 - 1, py = y + t / 3 % 3 - 1, pz = z + t % 3 - 1;
      if (px < 0 || px >= side || py < 0 || py >= side || pz < 0 || pz >= side) continue;
      for (long c = 0; c < channels(); ++c)
        sum += in((px * side + py) * side + pz, c) *
               static_cast<double>(w[static_cast<std::size_t>((n * channels() + c) * 27 + t)]);
    }
    return residual.empty() ? sum : sum + static_cast<double>(residual[static_cast<std::size_t>(i)]);
  }
};

Prepared prepare(Context& ctx, const ConvShape& s, bool references) {
  auto d = std::make_shared<Data>();
  d->shape = s;
  const long voxels = s.side * s.side * s.side, channels = d->channels();
  d->x0 = random_floats(voxels * s.cin, 1);
  d->x1 = random_floats(voxels * s.c1, 2);
  d->w = random_floats(27 * channels * s.cout, 3);
  d->bias = random_floats(s.cout, 4);
  Conv3dForward& c = d->conv;
  c.in.x0 = ctx.upload({voxels, s.cin}, d->x0);
  if (s.c1) c.in.x1 = ctx.upload({voxels, s.c1}, d->x1);
  if (s.prologue) {
    d->scale = random_floats(channels, 5, 0.5f, 2.0f);
    d->shift = random_floats(channels, 6);
    c.in.scale = ctx.upload({channels}, d->scale);
    c.in.shift = ctx.upload({channels}, d->shift);
    c.in.silu = true;
  }
  if (s.residual) {
    d->residual = random_floats(voxels * s.cout, 7);
    c.residual = ctx.upload({voxels, s.cout}, d->residual);
  }
  d->weights = pack_conv3d(ctx, d->w.data(), d->bias.data(), s.cout, channels, "weight", s.method);
  c.weights = &d->weights;
  c.x = c.y = c.z = s.side;
  c.out = ctx.tensor({voxels, s.cout});

  Prepared p;
  const double v = static_cast<double>(voxels), ci = static_cast<double>(channels), co = static_cast<double>(s.cout);
  p.cost = {2 * 27 * v * ci * co, 4 * (v * ci + 27 * ci * co + v * co * (s.residual ? 2 : 1))};
  p.performed_flops = conv3d_flops(d->weights, s.side, s.side, s.side);
  if (ctx.precision() == Precision::mixed && d->weights.winograd) p.tolerance = 3e-2;
  p.run = [&ctx, d] { conv3d_forward(ctx, d->conv); };
  p.error = [&ctx, d] {
    const auto got = ctx.read<float>(d->conv.out);
    return worst_error(
        static_cast<long>(got.size()), 200, [&](long i) { return got[static_cast<std::size_t>(i)]; },
        [&](long i) { return d->want(i); });
  };
  if (references)
    References::add_convolution(ctx, p, [&] {
      std::vector<float> composed;
      for (long voxel = 0; voxel < voxels; ++voxel)
        for (long at = 0; at < channels; ++at) composed.push_back(static_cast<float>(d->in(voxel, at)));
      return References::Convolution{s.side, channels, s.cout,      std::move(composed),
                                     d->w,   d->bias,  d->residual, [d](long i) { return d->want(i); }};
    });
  return p;
}

// The other directions and the stride of 2, at 48^3 voxels and 128 channels.
constexpr long kWide = 128;

RowSource volume(Context& ctx) {
  RowSource in;
  in.x0 = random(ctx, {kVoxels, kWide}, 1);
  return in;
}

Prepared backward_weights(Context& ctx) {
  Conv3dBackwardWeights g;
  g.in = volume(ctx);
  g.x = g.y = g.z = kSide;
  g.dy = random(ctx, {kVoxels, kWide}, 2);
  g.dw = random(ctx, {kWide, kWide, 3, 3, 3}, 3), g.dbias = random(ctx, {kWide}, 4);
  return operation(ctx, [&ctx, g] { conv3d_backward_weights(ctx, g); }, {g.dw, g.dbias});
}

Prepared backward_inputs(Context& ctx) {
  Conv3dBackwardInputs g;
  g.w = random(ctx, {kWide, kWide, 3, 3, 3}, 1);
  g.x = g.y = g.z = kSide;
  g.dy = random(ctx, {kVoxels, kWide}, 2), g.dx = ctx.tensor({kVoxels, kWide});
  return operation(ctx, [&ctx, g] { conv3d_backward_inputs(ctx, g); }, {g.dx});
}

Prepared down_forward(Context& ctx) {
  const auto w = random_floats(2 * kWide * kWide * 8, 3), bias = random_floats(2 * kWide, 4);
  const auto weights =
      std::make_shared<ConvWeights>(pack_conv3d_down(ctx, w.data(), bias.data(), 2 * kWide, kWide, "weight"));
  Conv3dDownForward c;
  c.in = volume(ctx);
  c.in.map = conv3d_down_map(ctx, kSide, kSide, kSide);
  c.weights = weights.get(), c.out = ctx.tensor({kVoxels / 8, 2 * kWide});
  return operation(ctx, [&ctx, c, weights] { conv3d_down_forward(ctx, c); }, {c.out});
}

Prepared down_backward(Context& ctx) {
  Conv3dDownBackward g;
  g.in = volume(ctx);
  g.in.map = conv3d_down_map(ctx, kSide, kSide, kSide);
  g.w = random(ctx, {2 * kWide, kWide, 2, 2, 2}, 3), g.dy = random(ctx, {kVoxels / 8, 2 * kWide}, 4);
  g.dx = random(ctx, {kVoxels, kWide}, 5), g.dw = random(ctx, g.w.shape(), 6), g.dbias = random(ctx, {2 * kWide}, 7);
  return operation(ctx, [&ctx, g] { conv3d_down_backward(ctx, g); }, {g.dx, g.dw, g.dbias});
}

}  // namespace

std::vector<Case> conv3d_cases(const Options& options) {
  std::vector<Case> cases;
  cases.reserve(kConvShapes.size() + 4);
  for (const ConvShape& s : kConvShapes)
    cases.push_back(
        {s.name, [s, references = options.references](Context& ctx) { return prepare(ctx, s, references); }});
  cases.push_back({"backward weights", backward_weights});
  cases.push_back({"backward inputs", backward_inputs});
  cases.push_back({"down forward", down_forward});
  cases.push_back({"down backward", down_backward});
  return cases;
}

}  // namespace vsplat::bench
