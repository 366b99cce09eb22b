#include "model/ops/networks/decode.h"

#include <numeric>

#include "model/diagnose/selftest/reference/decode.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class DecodeOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(DecodeOp);
VSPLAT_OPERATION(DecodeOp, decode)

using test::close;

DeviceGaussians nan_gaussians(Context& ctx, long n, long s, long scales = 3) {
  DeviceGaussians g;
  const auto make = [&](const Shape& shape, long count) {
    return ctx.upload(shape, test::nans(static_cast<std::size_t>(count)));
  };
  g.means = make({n, 3}, 3 * n);
  g.scales = make({n, scales}, scales * n);
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

// A loss that is linear in every Gaussian: its derivatives, for `n` of them.
ref::GaussianLists cotangents(long n, long s) {
  const auto random = [&](long count, std::uint32_t seed) {
    const std::vector<float> x = test::random_floats(static_cast<std::size_t>(count), seed);
    return std::vector<double>(x.begin(), x.end());
  };
  return {random(3 * n, 51), random(3 * n, 52), random(4 * n, 53), random(n, 54), random(3 * s * n, 55)};
}

GaussianGradients upload_gradients(Context& ctx, const ref::GaussianLists& g, long n, long s, long scales = 3) {
  const auto floats = [&](const Shape& shape, const std::vector<double>& x) {
    return ctx.upload(shape, std::vector<float>(x.begin(), x.end()));
  };
  return {floats({n, 3}, g.means), floats({n, scales}, g.scales), floats({n, 4}, g.quats), floats({n}, g.opacities),
          floats({n, s, 3}, g.sh)};
}

TEST(DecodeReference, GradientsAreThoseOfDifferences) {
  constexpr double step = 1e-5, anchor[3] = {0.1, -0.2, 0.3};
  const std::vector<float> random = test::random_floats(23 * 20, 56, -4.0f, 4.0f);
  const ref::GaussianLists d = cotangents(1, 4);
  for (const bool exponential : {false, true})
    for (std::size_t row = 0; row < random.size(); row += 23) {
      std::vector<double> raw(random.begin() + static_cast<long>(row), random.begin() + static_cast<long>(row + 23));
      const auto loss = [&] {
        ref::GaussianLists g;
        ref::decode(raw.data(), anchor, 0.25, 1, 12, g, 3, exponential);
        const auto dot = [](const std::vector<double>& x, const std::vector<double>& y) {
          return std::inner_product(x.begin(), x.end(), y.begin(), 0.0);
        };
        return dot(g.means, d.means) + dot(g.scales, d.scales) + dot(g.quats, d.quats) + dot(g.opacities, d.opacities) +
               dot(g.sh, d.sh);
      };
      std::vector<double> got;
      ref::decode_backward(raw.data(), 0.25, 1, 12, d, 0, got, 3, exponential);
      ASSERT_EQ(got.size(), raw.size());
      for (std::size_t i = 0; i < raw.size(); ++i) {
        const double at = raw[i];
        raw[i] = at + step;
        const double above = loss();
        raw[i] = at - step;
        EXPECT_NEAR(got[i], (above - loss()) / (2 * step), 1e-8) << i;
        raw[i] = at;
      }
    }
}

// Part by part: they are of different sizes.
void expect_raw(Context& ctx, const Tensor& draw, const std::vector<double>& want, long sh_size, long scales = 3) {
  const std::vector<float> got = ctx.read<float>(draw);
  ASSERT_EQ(got.size(), want.size());
  const long size = 8 + scales + sh_size, ends[] = {0, 3, 3 + sh_size, 4 + sh_size, 4 + scales + sh_size, size};
  for (int part = 0; part < 5; ++part) {
    std::vector<float> some;
    std::vector<double> expected;
    for (std::size_t i = 0; i < want.size(); ++i) {
      const long at = static_cast<long>(i) % size;
      if (at < ends[part] || at >= ends[part + 1]) continue;
      some.push_back(got[i]);
      expected.push_back(want[i]);
    }
    EXPECT_TRUE(close(some, expected, part == 1 ? 0 : 1e-6)) << "part " << part;
  }
}

// Several of a voxel, as surfels and as Gaussians, with exponential scales, farther from its centre; and their
// backward.
TEST(Decode, CoarseOfEveryKindMatchesReference) {
  Context& ctx = test::context(Flavour::cpu);
  for (const auto& [r, s, each, scales, exponential] :
       {std::tuple{3L, 4L, 2L, 2L, true}, {3L, 1L, 1L, 3L, true}, {2L, 9L, 3L, 2L, false}, {5L, 4L, 2L, 3L, false}}) {
    const long n = r * r * r * each, size = 8 + scales + 3 * s;
    const CoarseKind kind{each, 0.6, exponential};
    const std::vector<float> raw = test::random_floats(static_cast<std::size_t>(n * size), 41, -4.0f, 4.0f);
    const DeviceGaussians out = nan_gaussians(ctx, n, s, scales);
    const Tensor on_device = ctx.upload({r * r * r, each * size}, raw);
    decode_coarse_forward(ctx, {on_device, r, out, kind});
    ref::GaussianLists want, d = cotangents(n, s);
    d.scales.resize(static_cast<std::size_t>(n * scales));
    std::vector<double> by_raw;
    const double voxel = 1.0 / static_cast<double>(r);
    for (long k = 0; k < n; ++k) {
      const long i = k / each;
      const double anchor[3] = {(static_cast<double>(i / (r * r)) + 0.5) * voxel - 0.5,
                                (static_cast<double>(i / r % r) + 0.5) * voxel - 0.5,
                                (static_cast<double>(i % r) + 0.5) * voxel - 0.5};
      const float* row = &raw[static_cast<std::size_t>(k * size)];
      ref::decode(row, anchor, 0.6 * voxel, voxel, 3 * s, want, static_cast<int>(scales), exponential);
      ref::decode_backward(row, 0.6 * voxel, voxel, 3 * s, d, static_cast<std::size_t>(k), by_raw,
                           static_cast<std::size_t>(scales), exponential);
    }
    expect_equal(ctx, out, want);
    const Tensor draw = ctx.upload(on_device.shape(), test::nans(raw.size()));
    decode_coarse_backward(ctx, {on_device, r, upload_gradients(ctx, d, n, s, scales), draw, kind});
    expect_raw(ctx, draw, by_raw, 3 * s, scales);
  }
}

TEST(Decode, CoarseBackwardMatchesReference) {
  Context& ctx = test::context(Flavour::cpu);
  for (const auto& [r, s] : {std::pair{1L, 1L}, {3L, 4L}, {5L, 9L}, {4L, 16L}}) {
    const long n = r * r * r, size = 11 + 3 * s;
    const std::vector<float> raw = test::random_floats(static_cast<std::size_t>(n * size), 57, -4.0f, 4.0f);
    const ref::GaussianLists d = cotangents(n, s);
    const double voxel = 1.0 / static_cast<double>(r);
    std::vector<double> want;
    for (long i = 0; i < n; ++i)
      ref::decode_backward(&raw[static_cast<std::size_t>(i * size)], voxel / 4, voxel, 3 * s, d,
                           static_cast<std::size_t>(i), want);
    const Tensor draw = ctx.upload({n, size}, test::nans(raw.size()));
    decode_coarse_backward(ctx, {ctx.upload({n, size}, raw), r, upload_gradients(ctx, d, n, s), draw});
    expect_raw(ctx, draw, want, 3 * s);
  }
}

// For points, which are the means: a Gaussian of a voxel eight times as large without its offset; in some of the rows.
TEST(Decode, PointsAndTheirBackwardMatchReference) {
  Context& ctx = test::context(Flavour::cpu);
  for (const auto& [p, s, row0] : {std::tuple{1L, 1L, 0L}, {7L, 4L, 2L}, {65L, 4L, 5L}, {3L, 9L, 0L}}) {
    const long size = 8 + 3 * s, n = row0 + p + 1;
    const std::vector<float> raw = test::random_floats(static_cast<std::size_t>(p * size), 61, -4.0f, 4.0f);
    const std::vector<float> points = test::random_floats(static_cast<std::size_t>(3 * p), 62);
    const DeviceGaussians out = nan_gaussians(ctx, n, s);
    const Tensor on_device = ctx.upload({p, size}, raw);
    const double unit = 0.02;
    decode_points_forward(ctx, {on_device, ctx.upload({p, 3}, points), unit, row0, out});
    const ref::GaussianLists d = cotangents(n, s);
    ref::GaussianLists want;
    std::vector<double> by_raw, by_points;
    for (long i = 0; i < p; ++i) {
      // With an offset of 0 in front, which moves nothing.
      std::vector<double> row(raw.begin() + i * size, raw.begin() + (i + 1) * size);
      row.insert(row.begin(), 3, 0.0);
      const auto at = static_cast<std::size_t>(3 * i);
      const double anchor[3] = {points[at], points[at + 1], points[at + 2]};
      ref::decode(row.data(), anchor, 0, 3 * unit, 3 * s, want, 3, true);
      std::vector<double> back;
      const auto k = static_cast<std::size_t>(row0 + i);
      ref::decode_backward(row.data(), 0, 3 * unit, 3 * s, d, k, back, 3, true);
      by_raw.insert(by_raw.end(), back.begin() + 3, back.end());
      for (std::size_t a = 0; a < 3; ++a) by_points.push_back(d.means[3 * k + a]);
    }
    const auto written_rows = [&](const Tensor& t) {
      const auto all = ctx.read<float>(t);
      const long width = t.count() / n;
      for (long i = 0; i < n * width; ++i)
        EXPECT_EQ(std::isnan(all[static_cast<std::size_t>(i)]), i / width < row0 || i / width >= row0 + p);
      return std::vector<float>(all.begin() + row0 * width, all.begin() + (row0 + p) * width);
    };
    EXPECT_TRUE(close(written_rows(out.means), want.means, 0));
    EXPECT_TRUE(close(written_rows(out.scales), want.scales, 1e-6));
    EXPECT_TRUE(close(written_rows(out.quats), want.quats, 1e-6));
    EXPECT_TRUE(close(written_rows(out.opacities), want.opacities, 1e-6));
    EXPECT_TRUE(close(written_rows(out.sh), want.sh, 0));

    const Tensor draw = ctx.upload({p, size}, test::nans(raw.size()));
    const Tensor dpoints = ctx.upload({p, 3}, test::nans(points.size()));
    decode_points_backward(ctx, {on_device, unit, row0, upload_gradients(ctx, d, n, s), draw, dpoints});
    EXPECT_TRUE(close(ctx.read<float>(draw), by_raw, 1e-6));
    EXPECT_TRUE(close(ctx.read<float>(dpoints), by_points, 0));
    EXPECT_THROW(decode_points_forward(ctx, {on_device, dpoints, unit, row0 + 2, out}), Error);
  }
}

TEST(Decode, FineThenAdjustedBackwardMatchReference) {
  Context& ctx = test::context(Flavour::cpu);
  for (const auto& [p, m, s] : {std::tuple{1L, 1L, 1L}, {7L, 3L, 4L}, {65L, 2L, 4L}, {3L, 16L, 4L}}) {
    const long r = 6, size = 11 + 3 * s, n = p * m;
    const std::vector<float> raw = test::random_floats(static_cast<std::size_t>(n * size), 58, -4.0f, 4.0f);
    const std::vector<float> update = test::random_floats(static_cast<std::size_t>(p * (3 * s + 1)), 59, -3.0f, 3.0f);
    const std::vector<float> opacities = test::random_floats(static_cast<std::size_t>(p), 60, 0.2f, 1.0f);
    const ref::GaussianLists d = cotangents(n + p, s), before = cotangents(p, s);
    const GaussianGradients dout = upload_gradients(ctx, d, n + p, s);
    GaussianGradients to = upload_gradients(ctx, before, p, s);
    to.sh = {};
    const Tensor draw = ctx.upload({p, m * size}, test::nans(raw.size()));
    const Tensor dupdate = ctx.upload({p, 3 * s + 1}, test::nans(update.size()));
    decode_fine_backward(ctx, {ctx.upload({p, m * size}, raw), r, dout, draw, to.means});
    decode_adjusted_backward(ctx,
                             {ctx.upload({p, 3 * s + 1}, update), ctx.upload({p}, opacities), n, dout, dupdate, to});

    std::vector<double> want, want_update;
    ref::GaussianLists sums = before;
    for (long k = 0; k < n; ++k) {
      const auto at = static_cast<std::size_t>(k);
      ref::decode_backward(&raw[static_cast<std::size_t>(k * size)], 1.0 / 48, 1.0 / 6, 3 * s, d, at, want);
      for (std::size_t i = 0; i < 3; ++i) sums.means[3 * static_cast<std::size_t>(k / m) + i] += d.means[3 * at + i];
    }
    const auto sh = static_cast<std::size_t>(3 * s);
    for (std::size_t i = 0; i < opacities.size(); ++i) {
      const std::size_t k = static_cast<std::size_t>(n) + i;
      for (std::size_t c = 0; c < 3; ++c) sums.means[3 * i + c] += d.means[3 * k + c];
      for (std::size_t c = 0; c < 3; ++c) sums.scales[3 * i + c] += d.scales[3 * k + c];
      for (std::size_t c = 0; c < 4; ++c) sums.quats[4 * i + c] += d.quats[4 * k + c];
      const double factor = ref::logistic(update[i * (sh + 1) + sh]);
      sums.opacities[i] += d.opacities[k] * factor;
      for (std::size_t c = 0; c < sh; ++c) want_update.push_back(d.sh[k * sh + c]);
      want_update.push_back(d.opacities[k] * static_cast<double>(opacities[i]) * factor * (1 - factor));
    }
    expect_raw(ctx, draw, want, 3 * s);
    EXPECT_TRUE(close(ctx.read<float>(dupdate), want_update, 1e-7));
    EXPECT_TRUE(close(ctx.read<float>(to.means), sums.means, 1e-6));
    EXPECT_TRUE(close(ctx.read<float>(to.scales), sums.scales, 1e-6));
    EXPECT_TRUE(close(ctx.read<float>(to.quats), sums.quats, 1e-6));
    EXPECT_TRUE(close(ctx.read<float>(to.opacities), sums.opacities, 1e-6));
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

// Saturated numbers have gradients of 0 or all; a rotation too short to be a unit one is divided by 1e-12.
TEST(Decode, BackwardOfExtremeNumbersStaysFinite) {
  Context& ctx = test::context(Flavour::cpu);
  const ref::GaussianLists d = cotangents(1, 1);
  const std::vector<float> short_rotations[] = {{3e-9f, 0, 4e-9f, 0}, {3e-25f, 0, 4e-25f, 0}, {0, 0, 0, 0}};
  for (const std::vector<float>& q : short_rotations) {
    std::vector<float> raw = {-200, 200, 0, 1, 2, 3, 90, -40, 40, 200};
    raw.insert(raw.end(), q.begin(), q.end());
    std::vector<double> want;
    ref::decode_backward(raw.data(), 0.25, 1, 3, d, 0, want);
    const Tensor draw = ctx.upload({1, 14}, test::nans(14));
    decode_coarse_backward(ctx, {ctx.upload({1, 14}, raw), 1, upload_gradients(ctx, d, 1, 1), draw});
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
