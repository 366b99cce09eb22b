#include "model/ops/volume/sparse_conv.h"

#include "model/diagnose/selftest/inputs/voxels.h"
#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/sparse_conv.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class SparseConv : public test::FlavourTest {
 protected:
  // 4 channels to 5.
  SubmanifoldBackward make(long p, long side = 3) {
    const Shape w{5, side, side, side, 4};
    SubmanifoldBackward a;
    a.in.x0 = a.dx = ctx().tensor({p, 4}), a.w = ctx().tensor(w), a.dy = ctx().tensor({p, 5});
    if (side == 3) a.in.map = ctx().tensor({p, 27}, Type::i32);
    a.dw = ctx().upload(w, test::random_floats(static_cast<std::size_t>(20 * side * side * side), 10));
    a.dbias = ctx().upload({5}, std::vector<float>(5, 1.0f));
    return a;
  }
};
VSPLAT_FLAVOURS(SparseConv);
VSPLAT_OPERATION(SparseConv, sparse_conv)

TEST_P(SparseConv, NoRowsAddNothing) {
  for (const int side : {1, 3}) {
    const SubmanifoldBackward a = make(0, side);
    const auto dw = ctx().read<float>(a.dw);
    submanifold_backward(ctx(), a);
    EXPECT_EQ(ctx().read<float>(a.dw), dw);
    EXPECT_EQ(ctx().read<float>(a.dbias), std::vector<float>(5, 1.0f));
  }
}

// The convolution is linear in each of the three.
TEST(SparseConvReference, GradientsAreDifferences) {
  ref::SparseConvCase c;
  c.r = 3, c.cout = 3, c.voxel = selftest::some_voxels(3, 0.5f);
  c.in.rows = static_cast<long>(c.voxel.size()), c.in.c0 = 2;
  c.in.x0 = test::random_floats(2 * c.voxel.size(), 3), c.w = test::random_floats(3 * 27 * 2, 7);
  c.bias = test::random_floats(3, 8);
  const std::vector<float> dy = test::random_floats(3 * c.voxel.size(), 9);
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
  constexpr long p = 17;
  const auto expect_error = [&](const auto& spoil) {
    SubmanifoldBackward a = make(p);
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
