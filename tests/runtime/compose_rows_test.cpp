#include "runtime/compose_rows.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "model/diagnose/selftest/reference/gemm.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using test::random_floats;

class ComposeRows : public test::FlavourTest {
 protected:
  // All features of RowSource at once, or none; `taps` 0: no map.
  void expect_rows(long c0, long c1, bool affine, bool silu, long taps, long row0, long rows) {
    SCOPED_TRACE(
        fmt::format("{} + {} channels, affine {}, silu {}, {} taps, {} rows", c0, c1, affine, silu, taps, rows));
    const auto u = [](long v) { return static_cast<std::size_t>(v); };
    constexpr long src_rows = 11;
    ref::Rows a;
    a.rows = src_rows;
    a.c0 = c0;
    a.c1 = c1;
    a.silu = silu;
    a.x0 = random_floats(u(src_rows * c0), 1);
    a.x1 = random_floats(u(src_rows * c1), 2);
    RowSource in;
    in.silu = silu;
    in.x0 = ctx().upload({src_rows, c0}, a.x0);
    if (c1 > 0) in.x1 = ctx().upload({src_rows, c1}, a.x1);
    if (affine) {
      a.scale = random_floats(u(c0 + c1), 3);
      a.shift = random_floats(u(c0 + c1), 4);
      in.scale = ctx().upload({c0 + c1}, a.scale);
      in.shift = ctx().upload({c0 + c1}, a.shift);
    }
    std::vector<int> map;
    if (taps > 0) {
      for (long i = 0; i < (row0 + rows) * taps; ++i) map.push_back(static_cast<int>(i * 7 % 14) - 2);  // -2 to 11
      in.map = ctx().upload({row0 + rows, taps}, map, Type::i32);
    }
    const long width = std::max(1L, taps) * (c0 + c1);
    const Tensor out = ctx().upload({rows, width}, test::nans(u(rows * width)));
    compose_rows(ctx(), in, out, row0);
    std::vector<double> want;
    for (long m = row0; m < row0 + rows; ++m)
      for (long t = 0; t < std::max(1L, taps); ++t)
        for (long c = 0; c < c0 + c1; ++c) want.push_back(a.at(taps > 0 ? map[u(m * taps + t)] : m, c));
    EXPECT_TRUE(test::close(ctx().read<float>(out), want, 1e-6));
  }
};
VSPLAT_FLAVOURS(ComposeRows);

TEST_P(ComposeRows, MatchesWhatTheProductReads) {
  for (const long c0 : {1L, 7L, 16L, 17L, 33L})
    for (const long c1 : {0L, 1L, 16L, 19L}) {
      expect_rows(c0, c1, false, false, 0, 0, 11);
      expect_rows(c0, c1, true, true, 0, 4, 5);
      expect_rows(c0, c1, false, true, 0, 10, 1);
      expect_rows(c0, c1, true, true, 8, 0, 13);
      expect_rows(c0, c1, true, false, 27, 3, 6);
    }
}

TEST_P(ComposeRows, ARowIsZeroOnlyAfterShiftAndSilu) { expect_rows(5, 0, true, true, 3, 0, 5); }

TEST_P(ComposeRows, NoRowsAreNoWork) {
  RowSource in;
  in.x0 = ctx().tensor({0, 5});
  compose_rows(ctx(), in, ctx().tensor({0, 5}));
}

TEST_P(ComposeRows, RefusesRowsThatAreNotThere) {
  RowSource in;
  in.x0 = ctx().upload({3, 5}, random_floats(15, 1));
  EXPECT_THROW(compose_rows(ctx(), in, ctx().tensor({3, 5}), 1), Error);
  EXPECT_THROW(compose_rows(ctx(), in, ctx().tensor({3, 6})), Error);
}

}  // namespace
}  // namespace vsplat
