#include "model/diagnose/selftest/reference/space_curve.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/volume/space_curve.h"

namespace vsplat::selftest {
namespace {

void space_curve_all(Checks& c) {
  for (const long n : c.some({1L, 3L, 63L, 64L, 65L, 1009L}, {2L, 7L, 5000L})) {
    // Off the borders of cells, where floats and doubles may disagree.
    auto points = random_floats(size_of(3 * n), 4, 0, 1);
    for (float& v : points) v = (std::floor(v * 40) + 0.25f + 0.5f * (v * 40 - std::floor(v * 40))) / 64;
    for (std::size_t i = 0; i < 3; ++i) points[i] = 0;
    for (float& v : points) v -= 0.6f;
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
  for (const int depth : c.some({1, 5, 16}, {2, 3, 7, 8})) {
    std::vector<ref::Cell> cells, exchanged;
    std::vector<std::uint64_t> places, morton;
    std::mt19937_64 engine(6);
    for (int i = 0; i < 131; ++i) {
      places.push_back(engine() >> (64 - 3 * depth));
      cells.push_back(ref::hilbert_cell(places.back(), depth));
      morton.push_back(ref::morton(cells.back(), depth));
      exchanged.push_back({cells.back()[1], cells.back()[0], cells.back()[2]});
    }
    const GridCells grid{c.ctx.upload({131, 3}, cells.data(), Type::i32), depth};
    c.equal("Hilbert's places", curve_codes(c.ctx, grid, Curve::hilbert, false), places);
    c.equal("Morton's places", curve_codes(c.ctx, grid, Curve::morton, false), morton);
    if (!c.all) continue;
    const GridCells other{c.ctx.upload({131, 3}, exchanged.data(), Type::i32), depth};
    c.equal("Hilbert's places, axes exchanged", curve_codes(c.ctx, other, Curve::hilbert, true), places);
    c.equal("Morton's places, axes exchanged", curve_codes(c.ctx, other, Curve::morton, true), morton);
  }
  for (const long size : c.some({48L}, {1L, 5L}))
    for (const long n : c.some({1L, 5L, 47L, 48L, 49L, 97L, 211L}, {0L, 3L, 4L, 6L, 95L, 96L})) {
      std::vector<std::uint32_t> order(size_of(n));
      std::iota(order.begin(), order.end(), 0u);
      std::shuffle(order.begin(), order.end(), std::mt19937(8));
      const CurveRuns runs = curve_runs(c.ctx, c.up({n}, order), size);
      const auto want = ref::curve_runs(order, size);
      c.equal("runs", runs.slots, want);
      c.equal("runs' ends", runs.filled, std::vector<int>(want.begin() + n, want.end()));
      std::vector<int> places(size_of(n));
      for (std::size_t i = 0; i < order.size(); ++i) places[order[i]] = static_cast<int>(i);
      c.equal("places in runs", runs.places, places);
    }
}

}  // namespace

VSPLAT_CASES(space_curve, {"space_curve", space_curve_all})

}  // namespace vsplat::selftest
