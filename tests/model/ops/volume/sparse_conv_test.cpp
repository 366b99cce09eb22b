#include "model/ops/volume/sparse_conv.h"

#include <algorithm>

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/sparse_conv.h"
#include "model/ops/dense/conv3d.h"
#include "model/ops/volume/sparse_map.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

using test::random_floats;

std::size_t count(long a, long b) { return static_cast<std::size_t>(a * b); }

struct SparseConvTry {
  int r;
  float share;  // of the voxels that are active
  long cin, cout;
  long c1 = 0;
  bool norm = false;  // a scale, a shift and SiLU
  int side = 3;
};

ref::SparseConvCase make_case(const SparseConvTry& t) {
  ref::SparseConvCase c;
  c.side = t.side, c.r = t.r, c.cout = t.cout;
  const auto lot = random_floats(count(t.r, t.r) * static_cast<std::size_t>(t.r), 1, 0, 1);
  for (std::size_t v = 0; v < lot.size(); ++v)
    if (lot[v] < t.share) c.voxel.push_back(static_cast<int>(v));
  std::shuffle(c.voxel.begin(), c.voxel.end(), std::mt19937(2));
  const long p = static_cast<long>(c.voxel.size()), channels = t.cin + t.c1;
  c.in.rows = p, c.in.c0 = t.cin, c.in.c1 = t.c1, c.in.silu = t.norm;
  c.in.x0 = random_floats(count(p, t.cin), 3), c.in.x1 = random_floats(count(p, t.c1), 4);
  if (t.norm) {
    c.in.scale = random_floats(count(channels, 1), 5, 0.5f, 2.0f);
    c.in.shift = random_floats(count(channels, 1), 6);
  }
  c.w = random_floats(count(t.cout, c.taps() * channels), 7), c.bias = random_floats(count(t.cout, 1), 8);
  return c;
}

class SparseConv : public test::FlavourTest {
 protected:
  // With gradients to be written all NaN, and those to be added to as given.
  SubmanifoldBackward upload(const ref::SparseConvCase& c, const std::vector<float>& dy, const std::vector<float>& dw) {
    const long p = c.in.rows, cin = c.in.c0 + c.in.c1, k = c.side;
    SubmanifoldBackward a;
    a.in.x0 = ctx().upload({p, c.in.c0}, c.in.x0);
    if (c.in.c1) a.in.x1 = ctx().upload({p, c.in.c1}, c.in.x1);
    if (!c.in.scale.empty()) {
      a.in.scale = ctx().upload({cin}, c.in.scale);
      a.in.shift = ctx().upload({cin}, c.in.shift);
    }
    a.in.silu = c.in.silu;
    if (k == 3) {
      a.in.map = ctx().tensor({p, 27}, Type::i32);
      sparse_map_forward(ctx(), {ctx().upload({p}, c.voxel, Type::i32), c.r, a.in.map});
    }
    a.w = ctx().upload({c.cout, k, k, k, cin}, c.w);
    a.dy = ctx().upload({p, c.cout}, dy);
    a.dx = ctx().upload({p, cin}, test::nans(count(p, cin)));
    a.dw = ctx().upload({c.cout, k, k, k, cin}, dw);
    a.dbias = ctx().upload({c.cout}, std::vector<float>(static_cast<std::size_t>(c.cout), 1.0f));
    return a;
  }
};
VSPLAT_FLAVOURS(SparseConv);
VSPLAT_OPERATION(SparseConv, sparse_conv)

TEST_P(SparseConv, SameBitsTwiceAndInputsNotWanted) {
  const ref::SparseConvCase c = make_case({11, 0.9f, 40, 5, 0, true});
  const std::vector<float> dy = random_floats(count(c.in.rows, 5), 9), dw(c.w.size(), 0.0f);
  const SubmanifoldBackward a = upload(c, dy, dw);
  SubmanifoldBackward b = upload(c, dy, dw);
  b.dx = {};
  submanifold_backward(ctx(), a);
  submanifold_backward(ctx(), b);
  EXPECT_EQ(ctx().read<float>(a.dw), ctx().read<float>(b.dw));
  EXPECT_EQ(ctx().read<float>(a.dbias), ctx().read<float>(b.dbias));
}

TEST_P(SparseConv, NoRowsAddNothing) {
  for (const int side : {1, 3}) {
    const ref::SparseConvCase c = make_case({3, 0.0f, 4, 5, 0, false, side});
    const std::vector<float> dw = random_floats(c.w.size(), 10);
    const SubmanifoldBackward a = upload(c, {}, dw);
    submanifold_backward(ctx(), a);
    EXPECT_EQ(ctx().read<float>(a.dw), dw);
    EXPECT_EQ(ctx().read<float>(a.dbias), std::vector<float>(5, 1.0f));
  }
}

// The convolution is linear in each of the three.
TEST(SparseConvReference, GradientsAreDifferences) {
  ref::SparseConvCase c = make_case({3, 0.5f, 2, 3});
  const std::vector<float> dy = random_floats(count(c.in.rows, 3), 9);
  const auto differences = [&](std::vector<float>& v) {
    return ref::linear_differences(v, [&] { return ref::weighed(ref::sparse_conv(c), dy); });
  };
  const auto gradient = ref::sparse_conv_backward(c, dy);
  EXPECT_TRUE(test::close(gradient.dx, differences(c.in.x0), 1e-9));
  EXPECT_TRUE(test::close(gradient.dw, differences(c.w), 1e-9));
  EXPECT_TRUE(test::close(gradient.dbias, differences(c.bias), 1e-9));
}

TEST_P(SparseConv, PlanTakesTheSameMemory) {
  const auto own = test::open_context(GetParam());
  const auto run = [](Context& on) {
    SubmanifoldBackward a;
    a.in.x0 = on.tensor({1500, 40}), a.in.map = on.tensor({1500, 27}, Type::i32);
    a.in.scale = on.tensor({40}), a.in.shift = on.tensor({40}), a.in.silu = true;
    a.w = on.tensor({8, 3, 3, 3, 40}), a.dy = on.tensor({1500, 8}), a.dx = on.tensor({1500, 40});
    a.dw = on.tensor({8, 3, 3, 3, 40}), a.dbias = on.tensor({8});
    for (const Tensor& t : {a.in.x0, a.in.map, a.in.scale, a.in.shift, a.w, a.dy, a.dw, a.dbias}) on.fill_zero(t);
    submanifold_backward(on, a);
    return on.memory().peak_live();
  };
  const auto planner = own->planner();
  const std::size_t planned = run(*planner);
  EXPECT_EQ(run(*own), planned);
}

TEST_P(SparseConv, RejectsBadShapes) {
  const ref::SparseConvCase c = make_case({3, 0.6f, 4, 5});
  const long p = c.in.rows;
  const auto expect_error = [&](const std::function<void(SubmanifoldBackward&)>& spoil) {
    SubmanifoldBackward a = upload(c, random_floats(count(p, 5), 9), c.w);
    spoil(a);
    EXPECT_THROW(submanifold_backward(ctx(), a), Error);
  };
  expect_error([&](auto& a) { a.in.map = {}; });
  expect_error([&](auto& a) { a.in.map = ctx().tensor({p, 8}, Type::i32); });
  expect_error([&](auto& a) { a.in.x1 = ctx().tensor({p, 1}); });
  expect_error([&](auto& a) { a.dy = ctx().tensor({p, 4}); });
  expect_error([&](auto& a) { a.dx = ctx().tensor({p, 5}); });
  expect_error([&](auto& a) { a.dw = ctx().tensor({5, 3, 3, 3, 3}); });
}

}  // namespace
}  // namespace vsplat
