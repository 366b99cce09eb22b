#include <gtest/gtest.h>

#include "model/diagnose/selftest/reference/conv3d.h"
#include "model/diagnose/selftest/reference/differences.h"
#include "model/ops/dense/conv3d.h"
#include "tests/support/compare.h"
#include "tests/support/conv3d_cases.h"
#include "tests/support/counted.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using test::make_conv_case;
using test::random_floats;
using test::upload_rows;

class Conv3dInputs : public ::testing::TestWithParam<test::ConvWay> {
 protected:
  Context& ctx() { return test::context(GetParam().flavour); }
};

TEST_P(Conv3dInputs, RejectsWeightsOfAnotherShape) {
  for (const Shape& shape : {Shape{4, 5, 27}, Shape{4, 5, 3, 3, 2}, Shape{4, 5, 2, 2, 2}}) {
    Conv3dBackwardInputs g;
    g.w = ctx().tensor(shape);
    g.x = g.y = g.z = 1;
    g.dy = ctx().tensor({1, 4}), g.dx = ctx().tensor({1, 5});
    g.method = GetParam().method;
    EXPECT_THROW(conv3d_backward_inputs(ctx(), g), Error);
  }
}

class Conv3dWeights : public ::testing::TestWithParam<test::ConvWay> {
 protected:
  Context& ctx() { return test::context(GetParam().flavour); }
  static std::vector<float> zeros(std::size_t count) { return std::vector<float>(count, 0.0f); }

  Conv3dBackwardWeights upload(Context& on, const ref::ConvCase& c, const std::vector<float>& dy) {
    Conv3dBackwardWeights g;
    g.in = upload_rows(on, c.in);
    g.x = c.size[0], g.y = c.size[1], g.z = c.size[2];
    g.dy = on.upload({c.in.rows, c.cout}, dy);
    g.dw = on.upload({c.cout, c.in.c0 + c.in.c1, 3, 3, 3}, zeros(c.w.size()));
    g.dbias = on.upload({c.cout}, zeros(static_cast<std::size_t>(c.cout)));
    g.method = GetParam().method;
    return g;
  }
};

// As the forward's, see conv3d_test.cpp.
TEST_P(Conv3dWeights, ProfilesTellTheDirectOperationsAndThosePerformed) {
  const ref::ConvCase c = make_conv_case({{8, 4, 12}, 16, 32});
  const Conv3dBackwardWeights g = upload(ctx(), c, random_floats(8 * 4 * 12 * 32, 73));
  const ProfileRow row = test::profiled_row(ctx(), g.name, [&] { conv3d_backward_weights(ctx(), g); });
  EXPECT_DOUBLE_EQ(row.flops, 54.0 * 8 * 4 * 12 * 16 * 32);
  EXPECT_DOUBLE_EQ(row.performed_flops, row.flops / (GetParam().method == ConvMethod::winograd ? 4 : 1));
}

TEST_P(Conv3dWeights, PlanTakesTheSameMemory) {
  const ref::ConvCase c = make_conv_case({{12, 12, 16}, 13, 6});
  const std::vector<float> dy = random_floats(static_cast<std::size_t>(c.in.rows * 6), 75);
  const auto own = test::open_context(GetParam().flavour);
  const auto plan = own->planner();
  for (Context* at : {plan.get(), own.get()}) conv3d_backward_weights(*at, upload(*at, c, dy));
  EXPECT_EQ(own->memory().peak_live(), plan->memory().peak_live());
}

TEST_P(Conv3dWeights, RejectsBadShapes) {
  const ref::ConvCase c = make_conv_case({{3, 4, 5}, 6, 7});
  const Conv3dBackwardWeights good = upload(ctx(), c, random_floats(420, 76));
  const auto rejects = [&](auto change) {
    Conv3dBackwardWeights bad = good;
    change(bad);
    EXPECT_THROW(conv3d_backward_weights(ctx(), bad), Error);
  };
  rejects([](Conv3dBackwardWeights& b) { b.dw = Tensor(); });
  rejects([](Conv3dBackwardWeights& b) { b.dy = Tensor(); });
  rejects([](Conv3dBackwardWeights& b) { b.z = 6; });
  rejects([&](Conv3dBackwardWeights& b) { b.dw = ctx().tensor({7, 5, 3, 3, 3}); });
  rejects([&](Conv3dBackwardWeights& b) { b.dw = ctx().tensor({7, 6, 3, 3, 2}); });
  rejects([&](Conv3dBackwardWeights& b) { b.dy = ctx().tensor({60, 6}); });
  rejects([&](Conv3dBackwardWeights& b) { b.dbias = ctx().tensor({6}); });
}

INSTANTIATE_TEST_SUITE_P(Kernels, Conv3dInputs, test::conv_ways(), test::name_of_way);
INSTANTIATE_TEST_SUITE_P(Kernels, Conv3dWeights, test::conv_weights_ways(), test::name_of_way);

class Conv3dDownBackwardTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(Conv3dDownBackwardTest);

TEST_P(Conv3dDownBackwardTest, RejectsBadShapes) {
  Conv3dDownBackward g;
  g.in.x0 = ctx().tensor({64, 3});
  g.in.map = conv3d_down_map(ctx(), 4, 4, 4);
  g.w = g.dw = ctx().tensor({5, 3, 2, 2, 2});
  g.dy = ctx().tensor({8, 5});
  const auto rejects = [&](auto change) {
    Conv3dDownBackward bad = g;
    change(bad);
    EXPECT_THROW(conv3d_down_backward(ctx(), bad), Error);
  };
  rejects([](Conv3dDownBackward& b) { b.in.map = Tensor(); });
  rejects([&](Conv3dDownBackward& b) { b.dy = ctx().tensor({7, 5}); });
  rejects([&](Conv3dDownBackward& b) { b.dw = ctx().tensor({5, 3, 2, 4}); });
  rejects([&](Conv3dDownBackward& b) { b.dx = ctx().tensor({63, 3}); });
  rejects([&](Conv3dDownBackward& b) { b.in.x0 = ctx().tensor({64, 2}); });
  EXPECT_THROW(pack_conv3d_down(ctx(), ctx().tensor({5, 3, 3, 3, 3}), Tensor(), "weight"), Error);
}

// A convolution is linear in its weights, in its biases and in its inputs: differences are derivatives, but for
// rounding in double.
TEST(Conv3dReference, GradientsAreDifferences) {
  for (const long side : {3L, 2L}) {
    ref::ConvCase c = make_conv_case({{2, 3, 4}, 2, 3}, side);
    const std::vector<float> dy = random_floats(c.all().size(), 72);
    const auto differences = [&](std::vector<float>& by) {
      return ref::linear_differences(by, [&] { return ref::weighed(c.all(), dy); });
    };
    const ref::ConvGradient g = ref::conv_backward(c, dy);
    EXPECT_TRUE(test::close(g.dx, differences(c.in.x0), 1e-12)) << side;
    EXPECT_TRUE(test::close(g.dw, differences(c.w), 1e-12)) << side;
    EXPECT_TRUE(test::close(g.dbias, differences(c.bias), 1e-12)) << side;
  }
}

}  // namespace
}  // namespace vsplat
