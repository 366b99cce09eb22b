#include "model/ops/networks/decode.h"

#include "model/diagnose/selftest/inputs/gaussian_lists.h"
#include "model/diagnose/selftest/reference/decode.h"
#include "model/diagnose/selftest/reference/differences.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class DecodeOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(DecodeOp);
VSPLAT_OPERATION(DecodeOp, decode)

using selftest::gap_gaussians;
using selftest::slopes;
using selftest::up_slopes;
using test::close;

TEST(DecodeReference, GradientsAreThoseOfDifferences) {
  constexpr double anchor[3] = {0.1, -0.2, 0.3};
  const std::vector<float> random = test::random_floats(23 * 20, 56, -4.0f, 4.0f);
  const ref::GaussianLists d = slopes(1, 4);
  for (const bool exponential : {false, true})
    for (std::size_t row = 0; row < random.size(); row += 23) {
      std::vector<double> raw(random.begin() + static_cast<long>(row), random.begin() + static_cast<long>(row + 23));
      const auto loss = [&] {
        ref::GaussianLists g;
        ref::decode(raw.data(), anchor, 0.25, 1, 12, g, 3, exponential);
        return ref::weighed(g.means, d.means) + ref::weighed(g.scales, d.scales) + ref::weighed(g.quats, d.quats) +
               ref::weighed(g.opacities, d.opacities) + ref::weighed(g.sh, d.sh);
      };
      std::vector<double> got;
      ref::decode_backward(raw.data(), 0.25, 1, 12, d, 0, got, 3, exponential);
      ASSERT_EQ(got.size(), raw.size());
      const std::vector<double> want = ref::central_differences(raw, 1e-5, loss);
      for (std::size_t i = 0; i < raw.size(); ++i) EXPECT_NEAR(got[i], want[i], 1e-8) << i;
    }
}

// Points and adjusted Gaussians in some of the rows: as in the first rows, and no other is written.
TEST_P(DecodeOp, InSomeRows) {
  constexpr long p = 7, s = 4, row0 = 5, n = row0 + p + 1;
  const Tensor raw = ctx().upload({p, 8 + 3 * s}, test::random_floats(p * (8 + 3 * s), 61, -4, 4)),
               update = ctx().upload({p, 3 * s + 1}, test::random_floats(p * (3 * s + 1), 43, -3, 3)),
               points = ctx().upload({p, 3}, test::random_floats(3 * p, 62));
  const auto parts = [](const DeviceGaussians& g) {
    return std::vector<Tensor>{g.means, g.scales, g.quats, g.opacities, g.sh};
  };
  const auto expect_rows = [&](const DeviceGaussians& some, const DeviceGaussians& first) {
    for (std::size_t i = 0; i < 5; ++i) {
      const auto all = ctx().read<float>(parts(some)[i]), want = ctx().read<float>(parts(first)[i]);
      const std::size_t width = want.size() / p;
      for (std::size_t at = 0; at < all.size(); ++at)
        if (const long row = static_cast<long>(at / width) - row0; row < 0 || row >= p)
          EXPECT_TRUE(std::isnan(all[at])) << at;
        else
          EXPECT_EQ(all[at], want[at - row0 * width]) << at;
    }
  };
  const DeviceGaussians first = gap_gaussians(ctx(), p, s), some = gap_gaussians(ctx(), n, s),
                        adjusted = gap_gaussians(ctx(), p, s), others = gap_gaussians(ctx(), n, s);
  decode_points_forward(ctx(), {raw, points, 0.02, 0, first});
  decode_points_forward(ctx(), {raw, points, 0.02, row0, some});
  expect_rows(some, first);
  decode_adjusted_forward(ctx(), {update, first, 0, adjusted});
  decode_adjusted_forward(ctx(), {update, first, row0, others});
  expect_rows(others, adjusted);
  EXPECT_THROW(decode_points_forward(ctx(), {raw, points, 0.02, row0 + 2, some}), Error);

  // Their gradients read those rows.
  const ref::GaussianLists d = slopes(n, s);
  ref::GaussianLists rows;
  const auto cut = [&](const std::vector<double>& all) {
    const long width = static_cast<long>(all.size()) / n;
    return std::vector<double>(all.begin() + row0 * width, all.begin() + (row0 + p) * width);
  };
  rows = {cut(d.means), cut(d.scales), cut(d.quats), cut(d.opacities), cut(d.sh)};
  std::vector<std::vector<float>> got[2];
  for (const bool shifted : {false, true}) {
    const GaussianGradients dout = shifted ? up_slopes(ctx(), d, n, s) : up_slopes(ctx(), rows, p, s);
    const long from = shifted ? row0 : 0;
    const Tensor draw = ctx().tensor(raw.shape()), dpoints = ctx().tensor({p, 3}),
                 dupdate = ctx().tensor(update.shape());
    decode_points_backward(ctx(), {raw, 0.02, from, dout, draw, dpoints});
    GaussianGradients to = zero_gradients(ctx(), p, 1);
    to.sh = {};
    decode_adjusted_backward(ctx(), {update, first.opacities, from, dout, dupdate, to});
    for (const Tensor& t : {draw, dpoints, dupdate, to.means, to.opacities})
      got[shifted].push_back(ctx().read<float>(t));
  }
  EXPECT_EQ(got[0], got[1]);
}

// Far out the scale is linear or tiny but never 0 by rounding of 1 + e^x, and any rotation that is not 0 becomes a unit
// one.
TEST(Decode, ExtremeNumbersStayFinite) {
  Context& ctx = test::context(Flavour::cpu);
  const std::vector<float> raw = {-200, 200, 0, 1, 2, 3, 90, -40, 40, 200, 3e-9f, 0, 4e-9f, 0};
  const DeviceGaussians out = gap_gaussians(ctx, 1, 1);
  decode_coarse_forward(ctx, {ctx.upload({1, 14}, raw), 1, out});
  ref::GaussianLists want;
  const double anchor[3] = {0, 0, 0};
  ref::decode(raw.data(), anchor, 0.25, 1, 3, want);
  EXPECT_TRUE(close(ctx.read<float>(out.means), want.means, 1e-6));
  EXPECT_TRUE(close(ctx.read<float>(out.scales), want.scales, 1e-6));
  EXPECT_TRUE(close(ctx.read<float>(out.quats), want.quats, 1e-6));
  EXPECT_TRUE(close(ctx.read<float>(out.opacities), want.opacities, 1e-6));
  EXPECT_TRUE(close(ctx.read<float>(out.sh), want.sh, 0));
  EXPECT_TRUE(close(std::vector<float>{ctx.read<float>(out.scales)[0]}, std::vector<double>{want.scales[0]}, 1e-4));
  const std::vector<float> zero(14, 0.0f);
  decode_coarse_forward(ctx, {ctx.upload({1, 14}, zero), 1, out});
  EXPECT_EQ(ctx.read<float>(out.quats), std::vector<float>(4, 0.0f));  // as F.normalize: 0 / 1e-12
}

// Saturated numbers have gradients of 0 or all; a rotation too short to be a unit one is divided by 1e-12.
TEST(Decode, BackwardOfExtremeNumbersStaysFinite) {
  Context& ctx = test::context(Flavour::cpu);
  const ref::GaussianLists d = slopes(1, 1);
  const std::vector<float> short_rotations[] = {{3e-9f, 0, 4e-9f, 0}, {3e-25f, 0, 4e-25f, 0}, {0, 0, 0, 0}};
  for (const std::vector<float>& q : short_rotations) {
    std::vector<float> raw = {-200, 200, 0, 1, 2, 3, 90, -40, 40, 200};
    raw.insert(raw.end(), q.begin(), q.end());
    std::vector<double> want;
    ref::decode_backward(raw.data(), 0.25, 1, 3, d, 0, want);
    const Tensor draw = ctx.upload({1, 14}, test::nans(14));
    decode_coarse_backward(ctx, {ctx.upload({1, 14}, raw), 1, up_slopes(ctx, d, 1, 1), draw});
    const std::vector<float> got = ctx.read<float>(draw);
    for (std::size_t i = 0; i < 10; ++i) EXPECT_NEAR(got[i], want[i], 1e-6) << i;
    EXPECT_TRUE(close(std::vector<float>(got.begin() + 10, got.end()),
                      std::vector<double>(want.begin() + 10, want.end()), 1e-6));
  }
}

TEST(Decode, EmptyInput) {
  Context& ctx = test::context(Flavour::cpu);
  const DeviceGaussians none = make_gaussians(ctx, 0, 4, "none");
  decode_fine_forward(ctx, {ctx.tensor({0, 46}), none.means, ctx.tensor({2, 3}), 4, none});
  decode_adjusted_forward(ctx, {ctx.tensor({0, 13}), none, 0, none});
  EXPECT_EQ(download(ctx, none).count, 0u);
  const GaussianGradients nothing = zero_gradients(ctx, 0, 1);
  decode_fine_backward(ctx, {ctx.tensor({0, 46}), 4, nothing, ctx.tensor({0, 46}), nothing.means});
  decode_adjusted_backward(ctx, {ctx.tensor({0, 13}), ctx.tensor({0}), 0, nothing, ctx.tensor({0, 13}), nothing});
}

TEST(Decode, RejectsBadShape) {
  Context& ctx = test::context(Flavour::cpu);
  EXPECT_THROW(decode_coarse_forward(ctx, {ctx.tensor({8, 22}), 2, make_gaussians(ctx, 8, 4, "out")}), Error);
  EXPECT_THROW(decode_coarse_forward(ctx, {ctx.tensor({8, 23}), 3, make_gaussians(ctx, 8, 4, "out")}), Error);
  EXPECT_THROW(decode_coarse_forward(ctx, {ctx.tensor({8, 22}), 2, make_gaussians(ctx, 8, 4, "out", 2), {2}}), Error);
  EXPECT_THROW(decode_coarse_forward(ctx, {ctx.tensor({8, 21}), 2, make_gaussians(ctx, 8, 4, "out", 1)}), Error);
  const DeviceGaussians three = make_gaussians(ctx, 3, 4, "out");
  EXPECT_THROW(decode_fine_forward(ctx, {ctx.tensor({2, 46}), ctx.tensor({2, 3}), ctx.tensor({2, 3}), 4, three}),
               Error);
  EXPECT_THROW(decode_adjusted_forward(ctx, {ctx.tensor({3, 13}), three, 1, three}), Error);
  const GaussianGradients d = zero_gradients(ctx, 3, 1);
  EXPECT_THROW(decode_coarse_backward(ctx, {ctx.tensor({8, 23}), 2, d, ctx.tensor({8, 23})}), Error);
  const Tensor two = ctx.tensor({2, 46}), centres = ctx.tensor({2, 3});
  EXPECT_THROW(decode_fine_backward(ctx, {two, 4, d, two, centres}), Error);
  EXPECT_THROW(decode_fine_backward(ctx, {ctx.tensor({2, 24}), 4, d, ctx.tensor({2, 24}), centres}), Error);
  const Tensor update = ctx.tensor({3, 13});
  EXPECT_THROW(decode_adjusted_backward(ctx, {update, ctx.tensor({3}), 1, d, update, d}), Error);
  EXPECT_THROW(decode_adjusted_backward(ctx, {update, ctx.tensor({2}), 0, d, update, d}), Error);
}

}  // namespace
}  // namespace vsplat
