#include "model/render/render_backward.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/splat.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/gaussian_gradients.h"
#include "tests/support/scenes.h"
#include "tests/support/splat_golden.h"
#include "tests/support/vectors.h"

namespace vsplat {
namespace {

using test::SplatGolden;

// Relative to the largest value of each tensor.
constexpr double kTolerance = 1e-4;

PictureGradient upload_cotangent(Context& ctx, const Picture& p) {
  const long h = p.alpha.height, w = p.alpha.width;
  const auto map = [&](const Image& image, const Shape& shape) {
    return image.empty() ? Tensor() : ctx.upload(shape, image.data);
  };
  return {map(p.colour, {h, w, 3}), map(p.alpha, {h, w}), map(p.depth, {h, w}), map(p.normal, {h, w, 3}),
          map(p.distortion, {h, w})};
}

struct Gradient {
  Gaussians gaussians;
  std::vector<std::array<double, 6>> poses;  // one a camera
};

// Gradient of the sum over cameras.
Gradient differentiate(Context& ctx, const GaussianChunks& scene, const std::vector<Camera>& cameras,
                       const RenderOptions& options, const std::vector<Picture>& cotangents) {
  const SceneGradient out = zero_gradient(ctx, scene);
  Gradient result;
  for (std::size_t v = 0; v < cameras.size(); ++v) {
    result.poses.emplace_back();
    render_backward(ctx, scene, cameras[v], options, upload_cotangent(ctx, cotangents[v]), out, &result.poses.back());
  }
  result.gaussians = download(ctx, out, scene.sh_degree);
  return result;
}

class RenderBackwardGolden : public test::VectorsTest {};

// Compared with autograd in double, on scenes that avoid thresholds.
TEST_P(RenderBackwardGolden, MatchesAutogradAndGivesTheSameBytesEveryTime) {
  VSPLAT_NEED_SPLAT(name());
  const SplatGolden golden = SplatGolden::load(name());
  const auto run = [&] {
    return differentiate(ctx(), upload(ctx(), golden.gaussians), golden.cameras, golden.options, golden.cotangents);
  };
  const Gradient got = run();
  const Gaussians &g = got.gaussians, &want = golden.gradient;
  const auto all_zero = [](const std::vector<float>& v) {
    return std::all_of(v.begin(), v.end(), [](float x) { return x == 0; });
  };
  // Scenes without Gaussians, and scenes without view-dependent colour.
  const bool none = want.count == 0;
  for (const auto& [name, values] : test::kGaussianFields) {
    if (values == &Gaussians::sh) continue;
    EXPECT_TRUE(test::close(g.*values, want.*values, kTolerance, none)) << name;
  }
  if (none)
    EXPECT_TRUE(all_zero(g.sh) && all_zero(want.sh));
  else
    EXPECT_TRUE(test::close_by_channel(g.sh, want.sh, 3 * want.sh_count(), kTolerance)) << "sh";
  EXPECT_EQ(none, all_zero(want.means));
  for (std::size_t v = 0; v < golden.cameras.size(); ++v) {
    const auto &pose = got.poses[v], &wanted = golden.pose_gradient[v];
    // Rotation and translation have different scales.
    for (const std::ptrdiff_t first : {0, 3})
      EXPECT_TRUE(test::close(std::vector<double>(pose.begin() + first, pose.begin() + first + 3),
                              std::vector<double>(wanted.begin() + first, wanted.begin() + first + 3), kTolerance,
                              none))
          << "pose " << v << " from " << first;
  }
  for (int i = 0; i < 2; ++i) {
    const Gradient again = run();
    test::expect_same(again.gaussians, g);
    EXPECT_EQ(again.poses, got.poses);
  }
}

class RenderBackward : public test::FlavourTest {};

Picture random_cotangent(int width, int height) {
  Picture p{Image(width, height, 3), Image(width, height, 1), Image(width, height, 1)};
  p.colour.data = test::random_floats(p.colour.data.size(), 41);
  p.alpha.data = test::random_floats(p.alpha.data.size(), 42);
  p.depth.data = test::random_floats(p.depth.data.size(), 43);
  return p;
}

// Compared with differences of the reference's picture in double. Every Gaussian is wide enough to exceed 1/255 in
// every pixel, faint enough never to be limited to 0.99, and there are few enough that light gets through: no threshold
// is near.
TEST_P(RenderBackward, MatchesDifferences) {
  Gaussians g;
  g.count = 5;
  g.sh_degree = 2;
  const std::vector<float> at = test::random_floats(1000, 44);
  for (std::size_t k = 0; k < g.count; ++k) {
    const float* r = &at[60 * k];
    g.means.insert(g.means.end(), {0.3f * r[0], 0.3f * r[1], 0.5f * r[2]});
    g.scales.insert(g.scales.end(), {0.6f + 0.2f * r[3], 0.6f + 0.2f * r[4], 0.6f + 0.2f * r[5]});
    g.quats.insert(g.quats.end(), {r[6], r[7], r[8], 1.5f});
    g.opacities.push_back(0.5f + 0.3f * r[9]);
    for (std::size_t i = 0; i < 27; ++i) g.sh.push_back(0.2f * r[10 + i] + (i < 3 ? 0.8f : 0.0f));
  }
  const Camera cam = test::make_camera({"", 0, 0, 13, 11, ""}, 45);
  RenderOptions options;
  options.background = {0.2f, 0.4f, 0.9f};
  options.mirror = {0.1f, -0.2f, 0.3f};
  ref::Options reference;
  for (std::size_t i = 0; i < 3; ++i) reference.background[i] = options.background[i];
  reference.mirror = Eigen::Vector3f(0.1f, -0.2f, 0.3f).cast<double>();
  const Picture cotangent = random_cotangent(cam.width, cam.height);
  const auto loss = [&](const Gaussians& scene, const Camera& camera) {
    const ref::Frame f = ref::render(scene, camera, reference);
    return ref::weighed(f.colour, cotangent.colour.data) + ref::weighed(f.alpha, cotangent.alpha.data) +
           ref::weighed(f.depth, cotangent.depth.data);
  };
  const Gradient got = differentiate(ctx(), upload(ctx(), g), {cam}, options, {cotangent});
  test::expect_differences(got.gaussians, got.poses[0], g, cam, 0x1p-9f, loss);
}

// With little memory, sums are computed in another order, which is the only difference allowed.
TEST_P(RenderBackward, WorksInPartsWhereMemoryIsShort) {
  const test::SceneCase c{"", 150000, 0, 300, 200, ""};
  const Gaussians g = test::make_scene(c, 12);
  const Camera cam = test::make_camera(c, 12);
  const Picture cotangent = random_cotangent(cam.width, cam.height);
  const Gradient want = differentiate(ctx(), upload(ctx(), g), {cam}, {}, {cotangent});
  ContextOptions few;
  few.max_memory_gib = 0.045;
  const auto small = test::open_context(GetParam(), few);
  int parts = 0;
  for_each_part(*small, upload(*small, g), cam, {}, true,
                [&](Context& on, const Part&, const Projected&, const Binned& b) {
                  (void)on.tensor({b.ids.dim(0), 10});
                  parts += !on.planning();
                });
  EXPECT_GT(parts, 1);
  const Gradient got = differentiate(*small, upload(*small, g), {cam}, {}, {cotangent});
  test::expect_close(got.gaussians, want.gaussians, 1e-5);
  const auto values = [](const std::array<double, 6>& pose) { return std::vector<double>(pose.begin(), pose.end()); };
  EXPECT_TRUE(test::close(values(got.poses[0]), values(want.poses[0]), 1e-4));
  EXPECT_LE(static_cast<double>(small->memory().peak()), few.max_memory_gib * (1 << 30));
}

// Drawn once or twice, in one part or in several: the same gradients, for a loss that depends on the picture.
TEST_P(RenderBackward, AlongWithThePictureIsTheSame) {
  const test::SceneCase c{"", 150000, 0, 300, 200, ""};
  const Gaussians g = test::make_scene(c, 12);
  const Camera cam = test::make_camera(c, 12);
  for (const double gib : {0.0, 0.045}) {
    SCOPED_TRACE(gib);
    ContextOptions options;
    options.max_memory_gib = gib;
    const auto own = test::open_context(GetParam(), options);
    const GaussianChunks scene = upload(*own, g);
    const auto loss = [](Context& on, const DevicePicture& picture) {
      const Tensor gradient = on.tensor(picture.colour.shape());
      on.copy(picture.colour, gradient);
      return PictureGradient{gradient, {}, {}};
    };
    const SceneGradient want = zero_gradient(*own, scene), got = zero_gradient(*own, scene);
    const DevicePicture picture = render(*own, scene, cam, {});
    render_backward(*own, scene, cam, {}, loss(*own, picture), want, nullptr);
    const DrawnPicture again = render_with_backward(*own, scene, cam, {}, loss, got);
    EXPECT_EQ(own->read<float>(again.picture.colour), own->read<float>(picture.colour));
    EXPECT_GT(again.intersections, 10000U);
    const std::vector<float> means = own->read<float>(got[0].means);
    EXPECT_TRUE(std::any_of(means.begin(), means.end(), [](float x) { return x != 0; }));
    // In several parts, which may differ between calls, sums are computed in another order.
    EXPECT_TRUE(test::close(means, own->read<float>(want[0].means), gib > 0 ? 1e-5 : 0));
    EXPECT_TRUE(
        test::close(own->read<float>(got[0].opacities), own->read<float>(want[0].opacities), gib > 0 ? 1e-5 : 0));
  }
}

// A scene in several chunks gives the same bits.
TEST_P(RenderBackward, TakesAScenesChunks) {
  const test::SceneCase c{"", 70000, 1, 100, 80, ""};
  const Gaussians g = test::make_scene(c, 47);
  const Camera cam = test::make_camera(c, 47);
  const Picture cotangent = random_cotangent(cam.width, cam.height);
  const GaussianChunks chunks = test::in_chunks(g);
  ASSERT_EQ(chunks.chunks(), 2);
  const Gradient want = differentiate(ctx(), upload(ctx(), g), {cam}, {}, {cotangent});
  const Gradient got = differentiate(ctx(), chunks, {cam}, {}, {cotangent});
  test::expect_same(got.gaussians, want.gaussians);
  EXPECT_EQ(got.poses, want.poses);
}

// If all derivatives by the picture are zero, so are all results.
TEST_P(RenderBackward, IsZeroWhereTheLossIs) {
  const test::SceneCase c{"", 100, 1, 40, 40, ""};
  const Gaussians g = test::make_scene(c, 46);
  const Camera cam = test::make_camera(c, 46);
  const GaussianChunks scene = upload(ctx(), g);
  const SceneGradient out = zero_gradient(ctx(), scene);
  std::array<double, 6> pose{1, 1, 1, 1, 1, 1};
  render_backward(ctx(), scene, cam, {}, {}, out, &pose);
  const Gaussians got = download(ctx(), out, 1);
  for (const auto& [name, values] : test::kGaussianFields)
    EXPECT_EQ(got.*values, std::vector<float>((got.*values).size(), 0.0f)) << name;
  for (const double v : pose) EXPECT_EQ(v, 0);
}

VSPLAT_FLAVOURS(RenderBackward);

INSTANTIATE_TEST_SUITE_P(Committed, RenderBackwardGolden, test::in_both_flavours(test::splat_committed()),
                         test::vectors_name);
INSTANTIATE_TEST_SUITE_P(Made, RenderBackwardGolden, test::in_both_flavours(test::splat_made()), test::vectors_name);
INSTANTIATE_TEST_SUITE_P(CommittedSurfels, RenderBackwardGolden, test::in_both_flavours(test::surfels_committed()),
                         test::vectors_name);
INSTANTIATE_TEST_SUITE_P(MadeSurfels, RenderBackwardGolden, test::in_both_flavours(test::surfels_made()),
                         test::vectors_name);

}  // namespace
}  // namespace vsplat
