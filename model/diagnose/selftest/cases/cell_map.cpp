#include "model/diagnose/selftest/reference/cell_map.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/reference/space_curve.h"
#include "model/ops/render/radix_sort.h"
#include "model/ops/volume/cell_map.h"
#include "model/ops/volume/space_curve.h"
#include "model/ops/volume/sparse_conv.h"

namespace vsplat::selftest {
namespace {

std::vector<ref::Cell> some_cells(long n, int depth) {
  std::mt19937 engine(static_cast<std::uint32_t>(n + depth));
  std::vector<ref::Cell> out(size_of(n));
  for (ref::Cell& cell : out)
    for (int& axis : cell) axis = static_cast<int>(engine() % (1u << depth));
  return out;
}

// A convolution over cells, and its derivative by inputs, from the map.
void cell_convolution(Checks& c, const std::vector<int>& map, const CellMapForward& in, const Tensor& back) {
  constexpr long cin = 5, cout = 4;
  const long n = in.map.dim(0);
  const auto w = random_floats(cout * 27 * cin, 4), bias = random_floats(cout, 5),
             x = random_floats(size_of(n, cin), 6), dy = random_floats(size_of(n, cout), 7);
  std::vector<double> y(size_of(n, cout)), dx(size_of(n, cin)), dw(w.size()), dbias(cout);
  for (std::size_t at = 0; at < map.size(); ++at)
    for (std::size_t o = 0; o < cout; ++o) {
      const std::size_t p = at / 27, tap = at % 27;
      if (tap == 0) y[p * cout + o] += bias[o], dbias[o] += dy[p * cout + o];
      for (std::size_t ch = 0; map[at] >= 0 && ch < cin; ++ch) {
        const std::size_t q = static_cast<std::size_t>(map[at]) * cin + ch, k = (o * 27 + tap) * cin + ch;
        y[p * cout + o] += static_cast<double>(w[k]) * x[q];
        dx[q] += static_cast<double>(w[k]) * dy[p * cout + o];
        dw[k] += static_cast<double>(dy[p * cout + o]) * x[q];
      }
    }
  const ConvWeights packed = pack_submanifold(c.ctx, w.data(), bias.data(), cout, 27, cin, "weight");
  SubmanifoldForward f;
  f.in.x0 = c.up({n, cin}, x), f.in.map = in.map, f.weights = &packed, f.out = c.gap({n, cout});
  submanifold_forward(c.ctx, f);
  c.close("convolution", f.out, y, 1e-5);
  SubmanifoldBackward b;
  b.in = f.in, b.w = c.up({cout, 3, 3, 3, cin}, w), b.dy = c.up({n, cout}, dy), b.dx = c.gap({n, cin});
  b.dw = c.zeros(b.w.shape()), b.dbias = c.zeros({cout}), b.back = back;
  b.back_dy = cell_sums(c.ctx, b.dy, in.standing);
  submanifold_backward(c.ctx, b);
  c.close("convolution, dx", b.dx, dx, 1e-5);
  c.close("convolution, dw", b.dw, dw, 1e-5);
  c.close("convolution, dbias", b.dbias, dbias, 1e-5);
}

void cell_map_all(Checks& c) {
  struct Try {
    long n;
    int depth;
  };
  for (const Try& t : c.some({Try{1, 1}, {7, 1}, {64, 2}, {65, 3}, {131, 2}, {300, 9}},
                             {{0, 2}, {3, 1}, {7, 1}, {60, 2}, {211, 2}, {211, 3}}))
    for (const bool all : {false, true}) {
      const auto cells = some_cells(t.n, t.depth);
      CellMapForward in;
      in.cells = {c.ctx.upload({t.n, 3}, cells.data(), Type::i32), t.depth}, in.all = all;
      const Sorted sorted = radix_sort(c.ctx, curve_codes(c.ctx, in.cells, Curve::morton, false), {}, 3 * t.depth);
      in.codes = sorted.keys, in.points = sorted.values;
      in.standing = c.up({t.n}, std::vector<int>(size_of(t.n), -7));
      in.map = c.up({t.n, 27}, std::vector<int>(size_of(27 * t.n), -7));
      c.keep();  // codes, sorted
      cell_map_forward(c.ctx, in);
      const auto map = ref::cell_map(cells, all);
      std::vector<int> standing;
      for (const ref::Cell& cell : cells) standing.push_back(ref::standing(cells, cell));
      c.equal("map", in.map, map);
      c.equal("who stands for a cell", in.standing, standing);
      const auto x = random_floats(size_of(5 * t.n), 3);
      std::vector<double> sums(x.begin(), x.end());
      sums.resize(2 * x.size(), 0);
      for (std::size_t i = 0; i < x.size(); ++i)
        sums[x.size() + static_cast<std::size_t>(standing[i / 5]) * 5 + i % 5] += x[i];
      c.close("sums of cells", cell_sums(c.ctx, c.up({t.n, 5}, x), in.standing), sums, 1e-6);
      const Tensor back = c.ctx.tensor(in.map.shape(), Type::i32);
      cell_map_backward(c.ctx, {in.cells, in.codes, in.points, all, in.standing, back});
      cell_convolution(c, map, in, back);
    }
}

}  // namespace

VSPLAT_CASES(cell_map, {"cell_map", cell_map_all})

}  // namespace vsplat::selftest
