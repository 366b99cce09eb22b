// The refinement's submanifold convolutions, of a tenth of the volume's voxels, near a sphere.
#include <memory>

#include "bench/bench.h"
#include "bench/case_data.h"
#include "bench/ops/operation.h"
#include "model/ops/volume/sparse_conv.h"
#include "model/ops/volume/sparse_map.h"

namespace vsplat::bench {
namespace {

constexpr long kWidth = 256;

struct SparseShape {
  const char* name;
  long cin, cout, taps;
  bool norm;  // an affine with SiLU before it
  bool residual;
};

struct SparseData {
  SparseShape shape;
  std::vector<float> x, scale, shift, w, bias, residual;
  std::vector<int> map;  // [P, 27]; as the device has it, which was held to the grid
  ConvWeights weights;
  SubmanifoldForward conv;

  double in(long row, long c) const {
    double v = x[static_cast<std::size_t>(row * shape.cin + c)];
    if (!shape.norm) return v;
    v = v * static_cast<double>(scale[static_cast<std::size_t>(c)]) +
        static_cast<double>(shift[static_cast<std::size_t>(c)]);
    return v / (1 + std::exp(-v));
  }
  double weight(long n, long tap, long c) const {
    return w[static_cast<std::size_t>((n * shape.taps + tap) * shape.cin + c)];
  }
  // The row of a row's neighbour, or -1.
  long neighbour(long row, long tap) const {
    return shape.taps == 1 ? row : map[static_cast<std::size_t>(row * shape.taps + tap)];
  }
  double want(long i) const {
    const long row = i / shape.cout, n = i % shape.cout;
    double sum = static_cast<double>(bias[static_cast<std::size_t>(n)]);
    for (long tap = 0; tap < shape.taps; ++tap)
      if (const long from = neighbour(row, tap); from >= 0)
        for (long c = 0; c < shape.cin; ++c) sum += weight(n, tap, c) * in(from, c);
    return residual.empty() ? sum : sum + static_cast<double>(residual[static_cast<std::size_t>(i)]);
  }
};

// Every voxel's neighbours, by a table of the whole grid.
std::vector<int> neighbours(const std::vector<int>& voxels) {
  std::vector<int> rows(static_cast<std::size_t>(kVoxels), -1), out;
  for (std::size_t row = 0; row < voxels.size(); ++row)
    rows[static_cast<std::size_t>(voxels[row])] = static_cast<int>(row);
  for (const int voxel : voxels)
    for (long tap = 0; tap < 27; ++tap) {
      const long x = voxel / (kSide * kSide) + tap / 9 - 1, y = voxel / kSide % kSide + tap / 3 % 3 - 1,
                 z = voxel % kSide + tap % 3 - 1;
      const bool inside = x >= 0 && y >= 0 && z >= 0 && x < kSide && y < kSide && z < kSide;
      out.push_back(inside ? rows[static_cast<std::size_t>((x * kSide + y) * kSide + z)] : -1);
    }
  return out;
}

std::shared_ptr<SparseData> sparse_data(Context& ctx, const SparseShape& s) {
  auto d = std::make_shared<SparseData>();
  d->shape = s;
  const float reach = 1 / std::sqrt(static_cast<float>(s.taps * s.cin));
  d->x = random_floats(kSelected * s.cin, 1);
  d->w = random_floats(s.cout * s.taps * s.cin, 2, -reach, reach);
  d->bias = random_floats(s.cout, 3);
  SubmanifoldForward& a = d->conv;
  a.in.x0 = ctx.upload({kSelected, s.cin}, d->x);
  if (s.norm) {
    d->scale = random_floats(s.cin, 4, 0.5f, 2.0f), d->shift = random_floats(s.cin, 5);
    a.in.scale = ctx.upload({s.cin}, d->scale), a.in.shift = ctx.upload({s.cin}, d->shift);
    a.in.silu = true;
  }
  if (s.taps == 27) {
    const Tensor index = selected_voxels(ctx);
    d->map = neighbours(ctx.read<int>(index));
    a.in.map = ctx.tensor({kSelected, 27}, Type::i32);
    sparse_map_forward(ctx, {index, kSide, a.in.map});
  }
  if (s.residual) {
    d->residual = random_floats(kSelected * s.cout, 6);
    a.residual = ctx.upload({kSelected, s.cout}, d->residual);
  }
  d->weights = pack_submanifold(ctx, d->w.data(), d->bias.data(), s.cout, s.taps, s.cin, "bench");
  a.weights = &d->weights;
  a.out = ctx.tensor({kSelected, s.cout});
  return d;
}

// Pairs of a voxel and a neighbour.
double pairs(const SparseData& d) {
  if (d.map.empty()) return kSelected;
  return static_cast<double>(d.map.size()) - static_cast<double>(std::count(d.map.begin(), d.map.end(), -1));
}

Prepared prepare_sparse(Context& ctx, const SparseShape& s) {
  const auto d = sparse_data(ctx, s);
  Prepared p;
  if (ctx.precision() == Precision::mixed) p.tolerance = 8e-3;
  const double rows = kSelected, taps = static_cast<double>(s.taps), in = static_cast<double>(s.cin),
               out = static_cast<double>(s.cout);
  // By the definition only neighbours that are there count; the product is of all, zeros in place of the others.
  p.cost = {2 * pairs(*d) * in * out, 4 * (rows * in + taps * in * out + rows * out * (s.residual ? 2 : 1))};
  p.performed_flops = 2 * rows * taps * in * out;
  p.run = [&ctx, d] { submanifold_forward(ctx, d->conv); };
  p.error = [&ctx, d] {
    const auto got = ctx.read<float>(d->conv.out);
    return worst_error(
        static_cast<long>(got.size()), 200, [&](long i) { return got[static_cast<std::size_t>(i)]; },
        [&](long i) { return d->want(i); });
  };
  return p;
}

// All three gradients, sampled; those of weights and biases are added to what is there, which one run has done.
Prepared prepare_sparse_backward(Context& ctx, const SparseShape& s) {
  const auto d = sparse_data(ctx, s);
  const auto dy = std::make_shared<std::vector<float>>(random_floats(kSelected * s.cout, 7));
  SubmanifoldBackward b;
  b.in = d->conv.in;
  b.w = ctx.upload({s.cout, 3, 3, 3, s.cin}, d->w);
  b.dy = ctx.upload({kSelected, s.cout}, *dy);
  b.dx = ctx.tensor({kSelected, s.cin});
  b.dw = ctx.tensor(b.w.shape()), b.dbias = ctx.tensor({s.cout});
  ctx.fill_zero(b.dw), ctx.fill_zero(b.dbias);
  Prepared p = operation(ctx, [&ctx, b, d] { submanifold_backward(ctx, b); }, {b.dx, b.dw, b.dbias});
  p.error = [&ctx, b, d, dy] {
    const auto dx = ctx.read<float>(b.dx), dw = ctx.read<float>(b.dw), dbias = ctx.read<float>(b.dbias);
    const SparseShape& of = d->shape;
    const auto by = [&](long row, long n) {
      return static_cast<double>((*dy)[static_cast<std::size_t>(row * of.cout + n)]);
    };
    const auto worst = [](const std::vector<float>& got, const auto& want) {
      return worst_error(
          static_cast<long>(got.size()), 60, [&](long i) { return got[static_cast<std::size_t>(i)]; }, want);
    };
    // A voxel is its neighbour's neighbour, at the opposite tap.
    const double errors[] = {worst(dx,
                                   [&](long i) {
                                     double sum = 0;
                                     for (long tap = 0; tap < of.taps; ++tap)
                                       if (const long to = d->neighbour(i / of.cin, of.taps - 1 - tap); to >= 0)
                                         for (long n = 0; n < of.cout; ++n)
                                           sum += by(to, n) * d->weight(n, tap, i % of.cin);
                                     return sum;
                                   }),
                             worst(dw,
                                   [&](long i) {
                                     const long c = i % of.cin, tap = i / of.cin % of.taps, n = i / of.cin / of.taps;
                                     double sum = 0;
                                     for (long row = 0; row < kSelected; ++row)
                                       if (const long from = d->neighbour(row, tap); from >= 0)
                                         sum += by(row, n) * d->in(from, c);
                                     return sum;
                                   }),
                             worst(dbias, [&](long n) {
                               double sum = 0;
                               for (long row = 0; row < kSelected; ++row) sum += by(row, n);
                               return sum;
                             })};
    for (const double e : errors)
      if (!std::isfinite(e)) return e;
    return *std::max_element(std::begin(errors), std::end(errors));
  };
  return p;
}

}  // namespace

std::vector<Case> sparse_cases(const Options&) {
  std::vector<Case> cases;
  for (const SparseShape& s : {SparseShape{"conv_in.256-256", kWidth, kWidth, 27, false, false},
                               SparseShape{"res.256-256", kWidth, kWidth, 27, true, true},
                               SparseShape{"conv_out.1024-512", 1024, 512, 1, true, false}})
    cases.push_back({s.name, [s](Context& ctx) { return prepare_sparse(ctx, s); }});
  cases.push_back({"res.256-256 backward", [](Context& ctx) {
                     return prepare_sparse_backward(ctx, {"", kWidth, kWidth, 27, true, false});
                   }});
  return cases;
}

}  // namespace vsplat::bench
