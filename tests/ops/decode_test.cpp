#include "model/ops/decode.h"

#include "tests/reference/decode.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using test::close;

DeviceGaussians nan_gaussians(Context& ctx, long n, long s) {
  DeviceGaussians g;
  const auto make = [&](const Shape& shape, long count) {
    return ctx.upload(shape, test::nans(static_cast<std::size_t>(count)));
  };
  g.means = make({n, 3}, 3 * n);
  g.scales = make({n, 3}, 3 * n);
  g.quats = make({n, 4}, 4 * n);
  g.opacities = make({n}, n);
  g.sh = make({n, s, 3}, 3 * s * n);
  return g;
}

void expect_equal(Context& ctx, const DeviceGaussians& g, const ref::GaussianLists& want) {
  EXPECT_TRUE(close(ctx.read<float>(g.means), want.means, 1e-6));
  EXPECT_TRUE(close(ctx.read<float>(g.scales), want.scales, 1e-6));
  EXPECT_TRUE(close(ctx.read<float>(g.quats), want.quats, 1e-6));
  EXPECT_TRUE(close(ctx.read<float>(g.opacities), want.opacities, 1e-6));
  EXPECT_TRUE(close(ctx.read<float>(g.sh), want.sh, 0));
}

TEST(Decode, CoarseMatchesReference) {
  Context& ctx = test::context(Flavour::cpu);
  for (const auto& [r, s] : {std::pair{1L, 1L}, {3L, 4L}, {5L, 9L}, {4L, 16L}}) {
    const long n = r * r * r, size = 11 + 3 * s;
    const std::vector<float> raw = test::random_floats(static_cast<std::size_t>(n * size), 41, -4.0f, 4.0f);
    const DeviceGaussians out = nan_gaussians(ctx, n, s);
    decode_coarse_forward(ctx, {ctx.upload({n, size}, raw), r, out});
    ref::GaussianLists want;
    const double voxel = 1.0 / static_cast<double>(r);
    for (long i = 0; i < n; ++i) {
      const double anchor[3] = {(static_cast<double>(i / (r * r)) + 0.5) * voxel - 0.5,
                                (static_cast<double>(i / r % r) + 0.5) * voxel - 0.5,
                                (static_cast<double>(i % r) + 0.5) * voxel - 0.5};
      ref::decode(&raw[static_cast<std::size_t>(i * size)], anchor, voxel / 4, voxel, 3 * s, want);
    }
    expect_equal(ctx, out, want);
  }
}

TEST(Decode, FineThenAdjustedMatchReference) {
  Context& ctx = test::context(Flavour::cpu);
  for (const auto& [p, m, s] : {std::tuple{1L, 1L, 1L}, {7L, 3L, 4L}, {65L, 2L, 4L}}) {
    const long r = 6, size = 11 + 3 * s, n = p * m;
    const std::vector<float> raw = test::random_floats(static_cast<std::size_t>(n * size), 42, -4.0f, 4.0f);
    const std::vector<float> update = test::random_floats(static_cast<std::size_t>(p * (3 * s + 1)), 43, -3.0f, 3.0f);
    const std::vector<float> offsets = test::random_floats(static_cast<std::size_t>(3 * m), 44, -0.04f, 0.04f);
    Gaussians skeleton;
    skeleton.count = static_cast<std::size_t>(p);
    skeleton.sh_degree = s == 1 ? 0 : 1;
    skeleton.means = test::random_floats(skeleton.count * 3, 45, -0.5f, 0.5f);
    skeleton.scales = test::random_floats(skeleton.count * 3, 46, 0.01f, 0.1f);
    skeleton.quats = test::random_floats(skeleton.count * 4, 47);
    skeleton.opacities = test::random_floats(skeleton.count, 48, 0.0f, 1.0f);
    skeleton.sh = test::random_floats(skeleton.count * 3 * static_cast<std::size_t>(s), 49);
    const DeviceGaussians before = upload(ctx, skeleton), out = nan_gaussians(ctx, n + p, s);
    decode_fine_forward(ctx, {ctx.upload({p, m * size}, raw), before.means, ctx.upload({m, 3}, offsets), r, out});
    decode_adjusted_forward(ctx, {ctx.upload({p, 3 * s + 1}, update), before, n, out});

    ref::GaussianLists want;
    for (long k = 0; k < n; ++k) {
      double anchor[3];
      for (long i = 0; i < 3; ++i) {
        anchor[i] = static_cast<double>(skeleton.means[static_cast<std::size_t>(k / m * 3 + i)]) +
                    static_cast<double>(offsets[static_cast<std::size_t>(k % m * 3 + i)]);
      }
      ref::decode(&raw[static_cast<std::size_t>(k * size)], anchor, 1.0 / 48, 1.0 / 6, 3 * s, want);
    }
    for (std::size_t i = 0; i < skeleton.count; ++i) {
      const float* row = &update[i * static_cast<std::size_t>(3 * s + 1)];
      want.sh.insert(want.sh.end(), row, row + 3 * s);
      want.opacities.push_back(ref::logistic(row[3 * s]) * static_cast<double>(skeleton.opacities[i]));
    }
    want.means.insert(want.means.end(), skeleton.means.begin(), skeleton.means.end());
    want.scales.insert(want.scales.end(), skeleton.scales.begin(), skeleton.scales.end());
    want.quats.insert(want.quats.end(), skeleton.quats.begin(), skeleton.quats.end());
    expect_equal(ctx, out, want);
  }
}

// Far out the scale is linear or tiny but never 0 by rounding of 1 + e^x, and any rotation that is not 0 becomes a unit
// one.
TEST(Decode, ExtremeNumbersStayFinite) {
  Context& ctx = test::context(Flavour::cpu);
  const std::vector<float> raw = {-200, 200, 0, 1, 2, 3, 90, -40, 40, 200, 3e-9f, 0, 4e-9f, 0};
  const DeviceGaussians out = nan_gaussians(ctx, 1, 1);
  decode_coarse_forward(ctx, {ctx.upload({1, 14}, raw), 1, out});
  ref::GaussianLists want;
  const double anchor[3] = {0, 0, 0};
  ref::decode(raw.data(), anchor, 0.25, 1, 3, want);
  expect_equal(ctx, out, want);
  EXPECT_TRUE(close(std::vector<float>{ctx.read<float>(out.scales)[0]}, std::vector<double>{want.scales[0]}, 1e-4));
  const std::vector<float> zero(14, 0.0f);
  decode_coarse_forward(ctx, {ctx.upload({1, 14}, zero), 1, out});
  EXPECT_EQ(ctx.read<float>(out.quats), std::vector<float>(4, 0.0f));  // as F.normalize: 0 / 1e-12
}

TEST(Decode, EmptyInput) {
  Context& ctx = test::context(Flavour::cpu);
  const DeviceGaussians none = make_gaussians(ctx, 0, 4, "none");
  decode_fine_forward(ctx, {ctx.tensor({0, 46}), none.means, ctx.tensor({2, 3}), 4, none});
  decode_adjusted_forward(ctx, {ctx.tensor({0, 13}), none, 0, none});
  EXPECT_EQ(download(ctx, none).count, 0u);
}

TEST(Decode, RejectsBadShape) {
  Context& ctx = test::context(Flavour::cpu);
  EXPECT_THROW(decode_coarse_forward(ctx, {ctx.tensor({8, 22}), 2, make_gaussians(ctx, 8, 4, "out")}), Error);
  EXPECT_THROW(decode_coarse_forward(ctx, {ctx.tensor({8, 23}), 3, make_gaussians(ctx, 8, 4, "out")}), Error);
  const DeviceGaussians three = make_gaussians(ctx, 3, 4, "out");
  EXPECT_THROW(decode_fine_forward(ctx, {ctx.tensor({2, 46}), ctx.tensor({2, 3}), ctx.tensor({2, 3}), 4, three}),
               Error);
  EXPECT_THROW(decode_adjusted_forward(ctx, {ctx.tensor({3, 13}), three, 1, three}), Error);
}

}  // namespace
}  // namespace vsplat
