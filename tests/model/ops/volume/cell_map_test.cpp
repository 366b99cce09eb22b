#include "model/ops/volume/cell_map.h"

#include "model/diagnose/selftest/reference/cell_map.h"
#include "model/ops/render/radix_sort.h"
#include "model/ops/volume/sparse_conv.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class CellMap : public test::FlavourTest {
 protected:
  // Points in a cube of 2^depth cells along an edge, so few that some share a cell.
  void make(long n, int depth) {
    std::mt19937 engine(static_cast<std::uint32_t>(n + depth));
    cells_.clear();
    for (long i = 0; i < n; ++i) {
      ref::Cell& c = cells_.emplace_back();
      for (int& axis : c) axis = static_cast<int>(engine() % (1u << depth));
    }
    in_.cells = {ctx().upload({n, 3}, cells_.data(), Type::i32), depth};
    const Sorted sorted = radix_sort(ctx(), curve_codes(ctx(), in_.cells, Curve::morton, false), {}, 3 * depth);
    in_.codes = sorted.keys, in_.points = sorted.values;
    const std::vector<int> gaps(static_cast<std::size_t>(27 * n), -7);
    in_.standing = ctx().upload({n}, gaps, Type::i32), in_.map = ctx().upload({n, 27}, gaps, Type::i32);
  }
  CellMapBackward backward() {
    const CellMapBackward out{in_.cells, in_.codes,    in_.points,
                              in_.all,   in_.standing, ctx().tensor(in_.map.shape(), Type::i32)};
    cell_map_backward(ctx(), out);
    return out;
  }

  std::vector<ref::Cell> cells_;
  CellMapForward in_;
};
VSPLAT_FLAVOURS(CellMap);
VSPLAT_OPERATION(CellMap, cell_map)

TEST_P(CellMap, MatchesReference) {
  for (const auto& [n, depth] :
       {std::pair{0L, 2}, {1L, 1}, {3L, 1}, {7L, 1}, {64L, 2}, {211L, 2}, {211L, 3}, {300L, 9}})
    for (const bool all : {false, true}) {
      SCOPED_TRACE(std::to_string(n) + (all ? " all" : " spconv"));
      make(n, depth);
      in_.all = all;
      cell_map_forward(ctx(), in_);
      EXPECT_EQ(ctx().read<int>(in_.map), ref::cell_map(cells_, all));
      const auto standing = ctx().read<int>(in_.standing);
      for (std::size_t p = 0; p < cells_.size(); ++p) EXPECT_EQ(standing[p], ref::standing(cells_, cells_[p]));
    }
}

TEST_P(CellMap, SumsOfCells) {
  make(101, 2);
  cell_map_forward(ctx(), in_);
  const auto x = test::random_floats(101 * 5, 3);
  std::vector<double> want(x.begin(), x.end());
  want.resize(2 * x.size(), 0);
  for (std::size_t i = 0; i < x.size(); ++i)
    want[x.size() + static_cast<std::size_t>(ref::standing(cells_, cells_[i / 5])) * 5 + i % 5] += x[i];
  EXPECT_TRUE(test::close(ctx().read<float>(cell_sums(ctx(), ctx().upload({101, 5}, x), in_.standing)), want, 1e-6));
}

// A convolution over them and its derivative: by inputs, weights and biases, each from its definition.
TEST_P(CellMap, ConvolutionAndItsDerivative) {
  constexpr long cin = 5, cout = 4;
  const auto i = [](long v) { return static_cast<std::size_t>(v); };
  for (const long n : {1L, 3L, 60L, 131L})
    for (const bool all : {false, true}) {
      SCOPED_TRACE(std::to_string(n) + (all ? " all" : " spconv"));
      make(n, 2);
      in_.all = all;
      cell_map_forward(ctx(), in_);
      const auto map = ref::cell_map(cells_, all);
      const auto w = test::random_floats(cout * 27 * cin, 4), bias = test::random_floats(cout, 5),
                 x = test::random_floats(i(n * cin), 6), dy = test::random_floats(i(n * cout), 7);
      std::vector<double> y(i(n * cout)), dx(i(n * cin)), dw(w.size()), dbias(cout);
      for (long p = 0; p < n; ++p)
        for (long o = 0; o < cout; ++o) {
          y[i(p * cout + o)] += bias[i(o)];
          dbias[i(o)] += dy[i(p * cout + o)];
          for (long tap = 0; tap < 27; ++tap) {
            const long q = map[i(p * 27 + tap)];
            for (long c = 0; q >= 0 && c < cin; ++c) {
              const double weight = w[i((o * 27 + tap) * cin + c)], d = dy[i(p * cout + o)];
              y[i(p * cout + o)] += weight * x[i(q * cin + c)];
              dx[i(q * cin + c)] += weight * d;
              dw[i((o * 27 + tap) * cin + c)] += d * x[i(q * cin + c)];
            }
          }
        }
      const ConvWeights packed = pack_submanifold(ctx(), w.data(), bias.data(), cout, 27, cin, "weight");
      SubmanifoldForward f;
      f.in.x0 = ctx().upload({n, cin}, x);
      f.in.map = in_.map;
      f.weights = &packed;
      f.out = ctx().upload({n, cout}, test::nans(y.size()));
      submanifold_forward(ctx(), f);
      EXPECT_TRUE(test::close(ctx().read<float>(f.out), y, 1e-5));
      SubmanifoldBackward b;
      b.in = f.in;
      b.w = ctx().upload({cout, 3, 3, 3, cin}, w);
      b.dy = ctx().upload({n, cout}, dy);
      b.dx = ctx().upload({n, cin}, test::nans(dx.size()));
      b.dw = ctx().upload({cout, 3, 3, 3, cin}, std::vector<float>(w.size(), 0.0f));
      b.dbias = ctx().upload({cout}, std::vector<float>(cout, 0.0f));
      b.back = backward().map;
      b.back_dy = cell_sums(ctx(), b.dy, in_.standing);
      submanifold_backward(ctx(), b);
      EXPECT_TRUE(test::close(ctx().read<float>(b.dx), dx, 1e-5));
      EXPECT_TRUE(test::close(ctx().read<float>(b.dw), dw, 1e-5));
      EXPECT_TRUE(test::close(ctx().read<float>(b.dbias), dbias, 1e-5));
    }
}

TEST_P(CellMap, RejectsBadShape) {
  make(7, 1);
  in_.map = ctx().tensor({7, 26}, Type::i32);
  EXPECT_THROW(cell_map_forward(ctx(), in_), Error);
  in_.map = ctx().tensor({7, 27}, Type::i32);
  in_.codes = ctx().tensor({6}, Type::u64);
  EXPECT_THROW(cell_map_forward(ctx(), in_), Error);
}

}  // namespace
}  // namespace vsplat
