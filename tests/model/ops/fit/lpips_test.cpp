#include "model/ops/fit/lpips.h"

#include <fmt/format.h>

#include "model/diagnose/selftest/reference/lpips.h"
#include "runtime/gemm.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class LpipsOps : public test::FlavourTest {};
VSPLAT_FLAVOURS(LpipsOps);
VSPLAT_OPERATION(LpipsOps, lpips)

struct Shape2d {
  int height, width, cin, cout;
  Window2d window;
};

TEST_P(LpipsOps, AMapMakesAGemmAConvolution) {
  const Shape2d shapes[] = {{1, 1, 1, 1, {1, 1, 0}},    {3, 7, 3, 5, {3, 1, 1}},   {7, 3, 1, 17, {3, 1, 0}},
                            {11, 13, 3, 7, {11, 4, 2}}, {16, 15, 5, 3, {5, 1, 2}}, {17, 31, 3, 33, {11, 4, 2}},
                            {1, 5, 4, 2, {3, 2, 1}},    {2, 2, 2, 3, {3, 1, 1}}};
  for (const Shape2d& s : shapes) {
    SCOPED_TRACE(fmt::format("{} x {} x {}, window {}", s.height, s.width, s.cin, s.window.side));
    const auto taps = static_cast<std::size_t>(s.window.side * s.window.side);
    const auto in = test::random_floats(static_cast<std::size_t>(s.height) * s.width * s.cin, 1);
    const auto w = test::random_floats(s.cout * s.cin * taps, 2);
    const std::vector<double> want =
        ref::conv2d(in, s.height, s.width, s.cin, w, s.cout, static_cast<int>(s.window.side),
                    static_cast<int>(s.window.stride), static_cast<int>(s.window.pad));
    std::vector<float> last(w.size());
    for (int n = 0; n < s.cout; ++n)
      for (int c = 0; c < s.cin; ++c)
        for (std::size_t t = 0; t < taps; ++t) last[(n * taps + t) * s.cin + c] = w[(n * s.cin + c) * taps + t];
    const long k = static_cast<long>(taps) * s.cin;
    const PackedMatrix packed = pack_matrix(ctx(), last.data(), k, s.cout, 1, k, "w");
    const Tensor map = picture_map(ctx(), s.height, s.width, s.window);
    const long places = s.window.places(s.height) * s.window.places(s.width);
    ASSERT_EQ(map.shape(), (Shape{places, static_cast<long>(taps)}));
    const Tensor out = ctx().upload({places, s.cout}, test::nans(want.size()));
    Gemm g;
    g.a.x0 = ctx().upload({s.height, s.width, s.cin}, in);
    g.a.map = map;
    g.b = &packed;
    g.out = out;
    gemm(ctx(), g);
    EXPECT_TRUE(test::close(ctx().read<float>(out), want, 1e-5));
  }
}

TEST_P(LpipsOps, PoolingTakesTheLargest) {
  const Shape2d shapes[] = {{2, 2, 1, 0, {2, 2, 0}},   {3, 3, 7, 0, {3, 2, 0}},  {7, 8, 3, 0, {2, 2, 0}},
                            {13, 9, 64, 0, {3, 2, 0}}, {8, 17, 5, 0, {3, 2, 0}}, {5, 5, 101, 0, {2, 2, 0}}};
  for (const Shape2d& s : shapes) {
    SCOPED_TRACE(fmt::format("{} x {} x {}, window {}", s.height, s.width, s.cin, s.window.side));
    auto in = test::random_floats(static_cast<std::size_t>(s.height) * s.width * s.cin, 3, -2, -1);
    in[in.size() / 2] = 5;
    const auto side = static_cast<int>(s.window.side), stride = static_cast<int>(s.window.stride);
    const Tensor out = max_pool(ctx(), ctx().upload({s.height, s.width, s.cin}, in), s.window);
    EXPECT_EQ(out.shape(), (Shape{s.window.places(s.height), s.window.places(s.width), s.cin}));
    EXPECT_TRUE(test::close(ctx().read<float>(out), ref::max_pool(in, s.height, s.width, s.cin, side, stride), 0));
  }
}

TEST_P(LpipsOps, ReluClampsAndKeepsWhatIsNoNumber) {
  for (const std::size_t n : {1U, 3U, 63U, 64U, 65U, 1009U}) {
    auto x = test::random_floats(n, 4);
    x[0] = 0.5f;
    std::vector<float> want = x;
    for (float& v : want) v = v > 0 ? v : 0;
    const Tensor t = ctx().upload({static_cast<long>(n)}, x);
    relu(ctx(), t);
    EXPECT_EQ(ctx().read<float>(t), want);
  }
  const Tensor t = ctx().upload({2}, std::vector<float>{std::nanf(""), -1});
  relu(ctx(), t);
  EXPECT_TRUE(std::isnan(ctx().read<float>(t)[0]));
  relu(ctx(), ctx().tensor({0}));
}

TEST_P(LpipsOps, DistanceIsThatOfUnitVectors) {
  for (const auto& [places, channels] : {std::pair{1, 1}, {3, 7}, {7, 3}, {65, 64}, {64, 65}, {101, 512}}) {
    SCOPED_TRACE(fmt::format("{} x {}", places, channels));
    const std::size_t count = static_cast<std::size_t>(places) * channels;
    const auto a = test::random_floats(count, 5, 0, 1), weight = test::random_floats(channels, 7, 0.1f, 1);
    auto b = test::random_floats(count, 6, -0.5f, 1);
    if (channels == 1) b[0] = -0.3f;  // unit vectors of one number differ by their sign alone
    const Tensor out = ctx().upload({places}, test::nans(static_cast<std::size_t>(places)));
    feature_distance(ctx(), {ctx().upload({places, channels}, a), ctx().upload({places, channels}, b),
                             ctx().upload({channels}, weight), out});
    EXPECT_TRUE(test::close(ctx().read<float>(out), ref::feature_distance(a, b, weight), 1e-5));
  }
  // Features that are all zero have no direction, and are no error.
  const std::vector<float> zeros(8, 0.0f), some = {3, 0, 0, 4, 0, 1, 0, 0}, ones(4, 1.0f);
  const Tensor out = ctx().upload({2}, test::nans(2));
  feature_distance(ctx(), {ctx().upload({2, 4}, zeros), ctx().upload({2, 4}, some), ctx().upload({4}, ones), out});
  EXPECT_TRUE(test::close(ctx().read<float>(out), std::vector<double>{1, 1}, 1e-6));
}

TEST_P(LpipsOps, RejectsBadShapes) {
  EXPECT_THROW(picture_map(ctx(), 3, 9, {5, 1, 0}), Error);
  EXPECT_THROW(max_pool(ctx(), ctx().tensor({2, 5, 3}), {3, 2, 0}), Error);
  EXPECT_THROW(max_pool(ctx(), ctx().tensor({5, 5}), {3, 2, 0}), Error);
  const Tensor a = ctx().tensor({2, 4}), b = ctx().tensor({2, 3}), w = ctx().tensor({4}), out = ctx().tensor({2});
  EXPECT_THROW(feature_distance(ctx(), {a, b, w, out}), Error);
  EXPECT_THROW(feature_distance(ctx(), {a, a, out, out}), Error);
  EXPECT_THROW(feature_distance(ctx(), {a, a, w, w}), Error);
}

}  // namespace
}  // namespace vsplat
