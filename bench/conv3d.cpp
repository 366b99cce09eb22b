#include "model/ops/conv3d.h"

#include <memory>

#include "bench/bench.h"
#include "bench/sample.h"
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

Prepared prepare(Context& ctx, const ConvShape& s) {
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
  p.run = [&ctx, d] { conv3d_forward(ctx, d->conv); };
  p.error = [&ctx, d] {
    const auto got = ctx.read<float>(d->conv.out);
    return worst_error(
        static_cast<long>(got.size()), 200, [&](long i) { return got[static_cast<std::size_t>(i)]; },
        [&](long i) { return d->want(i); });
  };
  return p;
}

}  // namespace

std::vector<Case> conv_cases(const Options&) {
  std::vector<Case> cases;
  cases.reserve(kConvShapes.size());
  for (const ConvShape& s : kConvShapes) cases.push_back({s.name, [s](Context& ctx) { return prepare(ctx, s); }});
  return cases;
}

}  // namespace vsplat::bench
