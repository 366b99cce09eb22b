// Curves through points, their neighbours, how sure a network is of them, and what they become.
#include <algorithm>
#include <numeric>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/reference/cell_map.h"
#include "model/diagnose/selftest/reference/confidence.h"
#include "model/diagnose/selftest/reference/space_curve.h"
#include "model/diagnose/selftest/reference/upscale.h"
#include "model/ops/networks/confidence.h"
#include "model/ops/networks/upscale.h"
#include "model/ops/render/radix_sort.h"
#include "model/ops/volume/cell_map.h"
#include "model/ops/volume/space_curve.h"
#include "model/ops/volume/sparse_conv.h"

namespace vsplat::selftest {
namespace {

std::size_t point_size(long a, long b = 1) { return static_cast<std::size_t>(a * b); }

std::vector<ref::Cell> some_cells(long n, int depth) {
  std::mt19937 engine(static_cast<std::uint32_t>(n + depth));
  std::vector<ref::Cell> out(point_size(n));
  for (ref::Cell& cell : out)
    for (int& axis : cell) axis = static_cast<int>(engine() % (1u << depth));
  return out;
}

void space_curve_all(Checks& c) {
  for (const long n : c.some({1L, 3L, 63L, 64L, 65L, 1009L})) {
    // Off the borders of cells, where floats and doubles may disagree.
    auto points = random_floats(point_size(3 * n), 4, 0, 1);
    for (float& v : points) v = (std::floor(v * 40) + 0.25f + 0.5f * (v * 40 - std::floor(v * 40))) / 64;
    for (std::size_t i = 0; i < 3; ++i) points[i] = 0;
    const GridCells got = grid_cells(c.ctx, c.up({n, 3}, points), 1.0 / 64);
    std::vector<int> want;
    int largest = 1;
    for (const ref::Cell& cell : ref::grid_cells(points, 1.0 / 64))
      for (const int axis : cell) want.push_back(axis), largest = std::max(largest, axis);
    c.equal("cells", got.cells, want);
    int depth = 1;
    while (largest >> depth) ++depth;
    c.that("depth of the cells", got.depth == depth);
  }
  for (const int depth : {1, 5, 16}) {
    std::vector<ref::Cell> cells;
    std::vector<std::uint64_t> places, morton;
    std::mt19937_64 engine(6);
    for (int i = 0; i < 131; ++i) {
      places.push_back(engine() >> (64 - 3 * depth));
      cells.push_back(ref::hilbert_cell(places.back(), depth));
      morton.push_back(ref::morton(cells.back(), depth));
    }
    const GridCells grid{c.ctx.upload({131, 3}, cells.data(), Type::i32), depth};
    c.equal("Hilbert's places", curve_codes(c.ctx, grid, Curve::hilbert, false), places);
    c.equal("Morton's places", curve_codes(c.ctx, grid, Curve::morton, false), morton);
  }
  for (const long n : c.some({1L, 5L, 47L, 48L, 49L, 97L, 211L})) {
    std::vector<std::uint32_t> order(point_size(n));
    std::iota(order.begin(), order.end(), 0u);
    std::shuffle(order.begin(), order.end(), std::mt19937(8));
    const CurveRuns runs = curve_runs(c.ctx, c.up({n}, order), 48);
    const auto want = ref::curve_runs(order, 48);
    c.equal("runs", runs.slots, want);
    c.equal("runs' ends", runs.filled, std::vector<int>(want.begin() + n, want.end()));
    std::vector<int> places(point_size(n));
    for (std::size_t i = 0; i < order.size(); ++i) places[order[i]] = static_cast<int>(i);
    c.equal("places in runs", runs.places, places);
  }
}

// A convolution over cells, and its derivative by inputs, from the map.
void cell_convolution(Checks& c, const std::vector<int>& map, const CellMapForward& in, const Tensor& back) {
  constexpr long cin = 5, cout = 4;
  const long n = in.map.dim(0);
  const auto w = random_floats(cout * 27 * cin, 4), bias = random_floats(cout, 5),
             x = random_floats(point_size(n, cin), 6), dy = random_floats(point_size(n, cout), 7);
  std::vector<double> y(point_size(n, cout)), dx(point_size(n, cin)), dw(w.size()), dbias(cout);
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
  for (const Try& t : c.some({Try{1, 1}, {7, 1}, {64, 2}, {65, 3}, {131, 2}, {300, 9}}))
    for (const bool all : {false, true}) {
      const auto cells = some_cells(t.n, t.depth);
      CellMapForward in;
      in.cells = {c.ctx.upload({t.n, 3}, cells.data(), Type::i32), t.depth}, in.all = all;
      const Sorted sorted = radix_sort(c.ctx, curve_codes(c.ctx, in.cells, Curve::morton, false), {}, 3 * t.depth);
      in.codes = sorted.keys, in.points = sorted.values;
      in.standing = c.up({t.n}, std::vector<int>(point_size(t.n), -7));
      in.map = c.up({t.n, 27}, std::vector<int>(point_size(27 * t.n), -7));
      c.keep();  // codes, sorted
      cell_map_forward(c.ctx, in);
      const auto map = ref::cell_map(cells, all);
      std::vector<int> standing;
      for (const ref::Cell& cell : cells) standing.push_back(ref::standing(cells, cell));
      c.equal("map", in.map, map);
      c.equal("who stands for a cell", in.standing, standing);
      const auto x = random_floats(point_size(5 * t.n), 3);
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

void confidence_all(Checks& c) {
  for (const long p : c.some({3L, 7L, 63L, 64L, 65L, 211L}))
    for (const bool softmax : {false, true}) {
      const auto logits = random_floats(point_size(p), 1, -3, 3), x = random_floats(point_size(5 * p), 2),
                 dy = random_floats(point_size(5 * p), 3);
      const Tensor out = c.gap({p}), dx = c.gap({p, 5}), dlogits = c.gap({p});
      confidence_forward(c.ctx, {c.up({p}, logits), softmax, out});
      const auto want = ref::confidence(as_doubles(logits), softmax);
      c.close("forward", out, want, 1e-6);
      confidence_backward(c.ctx, {c.up({p, 5}, x), out, softmax, c.up({p, 5}, dy), dx, dlogits});
      std::vector<double> by;
      for (std::size_t i = 0; i < dy.size(); ++i) by.push_back(dy[i] * want[i / 5]);
      c.close("backward, dx", dx, by, 1e-6);
      c.close(
          "backward, dlogits", dlogits, [&] { return ref::confidence_backward(as_doubles(logits), softmax, x, dy); },
          2e-5);
    }
}

void upscale_all(Checks& c) {
  struct Try {
    long p, f, n, channels;
  };
  for (const Try& t : c.some({Try{1, 1, 1, 1}, {3, 2, 2, 5}, {7, 4, 3, 16}, {65, 2, 1, 3}})) {
    const long wide = 6 * t.n + t.channels;
    const auto raw = random_floats(point_size(3 * t.p, t.f), 1, -2, 2), points = random_floats(point_size(3 * t.p), 2),
               feature = random_floats(point_size(t.p, t.channels), 3),
               dchildren = random_floats(point_size(3 * t.p, t.f), 4),
               dwide = random_floats(point_size(t.p * t.f, wide), 5), before = random_floats(feature.size(), 6);
    const double reach = 0.02, unit = 50;
    const ref::UpscaleCase want{point_size(t.f), point_size(t.n),    point_size(t.channels), reach, unit,
                                as_doubles(raw), as_doubles(points), as_doubles(feature)};
    const Tensor in = c.up({t.p, 3 * t.f}, raw), children = c.gap({t.p * t.f, 3}), offsets = c.gap({t.p * t.f, 3}),
                 out = c.gap({t.p * t.f, wide});
    upscale_forward(c.ctx, {in, c.up({t.p, 3}, points), c.up({t.p, t.channels}, feature), t.n, reach, unit, children,
                            offsets, out});
    const auto there = want.forward();
    c.close("children", children, there.children, 1e-6);
    c.close("offsets", offsets, there.offsets, 1e-6);
    c.close("waves and features", out, there.wide, 1e-5);
    const Tensor draw = c.gap({t.p, 3 * t.f}), dpoints = c.gap({t.p, 3}), dfeature = c.up({t.p, t.channels}, before);
    upscale_backward(c.ctx, {in, t.n, reach, unit, c.up({t.p * t.f, 3}, dchildren), c.up({t.p * t.f, wide}, dwide),
                             draw, dpoints, dfeature});
    c.close(
        "backward, draw", draw, [&] { return want.gradient(&ref::UpscaleCase::raw, dchildren, dwide); }, 2e-5);
    c.close(
        "backward, dpoints", dpoints, [&] { return want.gradient(&ref::UpscaleCase::points, dchildren, dwide); }, 1e-5);
    c.close(
        "backward, dfeature", dfeature,
        [&] {
          auto sums = want.gradient(&ref::UpscaleCase::feature, dchildren, dwide);
          for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += before[i];
          return sums;
        },
        1e-5);
  }
}

}  // namespace

std::vector<Case> point_cases() {
  return {{"space_curve", space_curve_all},
          {"cell_map", cell_map_all},
          {"confidence", confidence_all},
          {"upscale", upscale_all}};
}

}  // namespace vsplat::selftest
