#include <fmt/format.h>
#include <gtest/gtest.h>

#include "model/diagnose/selftest/reference/conv3d.h"
#include "model/ops/dense/conv3d.h"
#include "tests/support/compare.h"
#include "tests/support/conv3d_cases.h"
#include "tests/support/counted.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using test::ConvTry;
using test::make_conv_case;
using test::random_floats;
using test::upload_rows;

class Conv3dInputs : public ::testing::TestWithParam<test::ConvWay> {
 protected:
  Context& ctx() { return test::context(GetParam().flavour); }
  double tolerance() const { return GetParam().method == ConvMethod::winograd ? 2e-5 : 1e-5; }
};

TEST_P(Conv3dInputs, MatchesReference) {
  for (const std::array<long, 3>& size :
       {std::array<long, 3>{1, 1, 1}, {2, 3, 1}, {3, 5, 13}, {4, 1, 12}, {7, 4, 2}, {5, 9, 65}})
    for (const auto& [cin, cout] : {std::pair{1L, 1L}, {7L, 5L}, {33L, 17L}, {16L, 32L}, {5L, 65L}}) {
      const ref::ConvCase c = make_conv_case({size, cin, cout});
      const std::vector<float> dy = random_floats(static_cast<std::size_t>(c.in.rows * cout), 71);
      Conv3dBackwardInputs g;
      g.w = ctx().upload({cout, cin, 3, 3, 3}, c.w);
      g.x = size[0], g.y = size[1], g.z = size[2];
      g.dy = ctx().upload({c.in.rows, cout}, dy);
      g.dx = ctx().upload({c.in.rows, cin}, test::nans(static_cast<std::size_t>(c.in.rows * cin)));
      g.method = GetParam().method;
      conv3d_backward_inputs(ctx(), g);
      EXPECT_TRUE(test::close(ctx().read<float>(g.dx), ref::conv_backward(c, dy).dx, tolerance()))
          << size[0] << "x" << size[1] << "x" << size[2] << " " << cin << " -> " << cout;
    }
}

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
  double tolerance() const { return GetParam().method == ConvMethod::winograd ? 2e-5 : 1e-5; }
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

  void expect_matches(const ConvTry& t) {
    SCOPED_TRACE(fmt::format("{}x{}x{} {}+{} -> {} affine {} silu {}", t.size[0], t.size[1], t.size[2], t.cin, t.c1,
                             t.cout, t.affine, t.silu));
    const ref::ConvCase c = make_conv_case(t);
    const std::vector<float> dy = random_floats(static_cast<std::size_t>(c.in.rows * t.cout), 73);
    const Conv3dBackwardWeights g = upload(ctx(), c, dy);
    conv3d_backward_weights(ctx(), g);
    const ref::ConvGradient want = ref::conv_backward(c, dy);
    EXPECT_TRUE(test::close(ctx().read<float>(g.dw), want.dw, tolerance()));
    EXPECT_TRUE(test::close(ctx().read<float>(g.dbias), want.dbias, 1e-5));
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

TEST_P(Conv3dWeights, EverySizeMatchesReference) {
  for (const std::array<long, 3>& size :
       {std::array<long, 3>{1, 1, 1}, {1, 2, 3}, {3, 5, 13}, {4, 1, 12}, {7, 4, 2}, {5, 9, 65}})
    for (const auto& [cin, cout] : {std::pair{1L, 1L}, {7L, 5L}, {11L, 31L}, {12L, 32L}, {13L, 33L}, {65L, 67L}})
      expect_matches({size, cin, cout});
}

TEST_P(Conv3dWeights, EveryCompositionMatchesReference) {
  for (const long c1 : {0L, 5L, 16L})
    for (const bool affine : {false, true})
      for (const bool silu : {false, true}) {
        ConvTry t{{4, 3, 7}, 17, 20, c1};
        t.affine = affine, t.silu = silu;
        expect_matches(t);
      }
}

// Several chunks, the last of them shorter than the others.
TEST_P(Conv3dWeights, ManyVoxelsMatchReference) {
  expect_matches({{13, 19, 17}, 3, 5});
  expect_matches({{2, 3, 1100}, 2, 1});
}

// What is there stays; a bias is not needed; the same bits each time.
TEST_P(Conv3dWeights, AddsAndRepeats) {
  const ref::ConvCase c = make_conv_case({{12, 12, 16}, 9, 10});
  const std::vector<float> dy = random_floats(static_cast<std::size_t>(c.in.rows * 10), 74);
  Conv3dBackwardWeights g = upload(ctx(), c, dy);
  conv3d_backward_weights(ctx(), g);
  const std::vector<float> once = ctx().read<float>(g.dw), bias = ctx().read<float>(g.dbias);
  conv3d_backward_weights(ctx(), g);
  std::vector<float> twice = once;
  for (float& v : twice) v += v;
  EXPECT_EQ(ctx().read<float>(g.dw), twice);
  g = upload(ctx(), c, dy);
  const Tensor untouched = g.dbias;
  g.dbias = Tensor();
  conv3d_backward_weights(ctx(), g);
  EXPECT_EQ(ctx().read<float>(g.dw), once);
  EXPECT_EQ(ctx().read<float>(untouched), zeros(10));
  EXPECT_NE(bias, zeros(10));
}

TEST_P(Conv3dWeights, EmptyAddsNothing) {
  const ref::ConvCase c = make_conv_case({{0, 3, 4}, 5, 6});
  const Conv3dBackwardWeights g = upload(ctx(), c, {});
  conv3d_backward_weights(ctx(), g);
  EXPECT_EQ(ctx().read<float>(g.dw), zeros(c.w.size()));
  EXPECT_EQ(ctx().read<float>(g.dbias), zeros(6));
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

// All three are added to: the gradients start from something else, and dx keeps it where no patch is.
TEST_P(Conv3dDownBackwardTest, MatchesReference) {
  for (const std::array<long, 3>& size : {std::array<long, 3>{2, 2, 2}, {1, 4, 4}, {5, 3, 7}, {16, 12, 26}})
    for (const auto& [cin, cout] : {std::pair{1L, 1L}, {3L, 7L}, {17L, 33L}}) {
      ConvTry t{size, cin, cout};
      t.affine = t.silu = cin > 1;
      const ref::ConvCase c = make_conv_case(t, 2);
      const auto out = c.out_size();
      const long rows = out[0] * out[1] * out[2];
      const std::vector<float> dy = random_floats(static_cast<std::size_t>(rows * cout), 71);
      ref::ConvGradient want = ref::conv_backward(c, dy);
      const auto from = [&](std::vector<double>& values, const Shape& shape, std::uint32_t seed) {
        const std::vector<float> before = random_floats(values.size(), seed, 1, 2);
        for (std::size_t i = 0; i < values.size(); ++i) values[i] += before[i];
        return ctx().upload(shape, before);
      };
      Conv3dDownBackward g;
      g.in = upload_rows(ctx(), c.in);
      g.in.map = conv3d_down_map(ctx(), size[0], size[1], size[2]);
      g.w = ctx().upload({cout, cin, 2, 2, 2}, c.w);
      g.dy = ctx().upload({rows, cout}, dy);
      g.dx = from(want.dx, {c.in.rows, cin}, 72);
      g.dw = from(want.dw, {cout, cin, 2, 2, 2}, 73);
      g.dbias = from(want.dbias, {cout}, 74);
      conv3d_down_backward(ctx(), g);
      SCOPED_TRACE(fmt::format("{}x{}x{} {} -> {}", size[0], size[1], size[2], cin, cout));
      EXPECT_TRUE(test::close(ctx().read<float>(g.dx), want.dx, 1e-5));
      EXPECT_TRUE(test::close(ctx().read<float>(g.dw), want.dw, 1e-5));
      EXPECT_TRUE(test::close(ctx().read<float>(g.dbias), want.dbias, 1e-5));
    }
}

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
    const auto loss = [&] {
      const std::vector<double> y = c.all();
      double sum = 0;
      for (std::size_t i = 0; i < y.size(); ++i) sum += y[i] * dy[i];
      return sum;
    };
    const auto differences = [&](std::vector<float>& by) {
      std::vector<double> out;
      for (float& v : by) {
        const float at = v;
        v = 1.0f;
        const double more = loss();
        v = -1.0f;
        out.push_back((more - loss()) / 2);
        v = at;
      }
      return out;
    };
    const ref::ConvGradient g = ref::conv_backward(c, dy);
    EXPECT_TRUE(test::close(g.dx, differences(c.in.x0), 1e-12)) << side;
    EXPECT_TRUE(test::close(g.dw, differences(c.w), 1e-12)) << side;
    EXPECT_TRUE(test::close(g.dbias, differences(c.bias), 1e-12)) << side;
  }
}

}  // namespace
}  // namespace vsplat
