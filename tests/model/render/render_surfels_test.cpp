// Surfels drawn and differentiated as a whole, like volumes in render_test.cpp and render_backward_test.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/surfels.h"
#include "model/render/render.h"
#include "model/render/render_backward.h"
#include "tests/support/close_pictures.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/gaussian_gradients.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

using test::SceneCase;

class RenderSurfels : public test::FlavourTest {};

RenderOptions all_maps(bool current = false) {
  RenderOptions options;
  options.background = {1, 0.5f, 0};
  options.maps = {true, true, true};
  options.revision = current ? SurfelRevision::current : SurfelRevision::lara;
  return options;
}

ref::SurfelOptions reference_of(const RenderOptions& options) {
  ref::SurfelOptions o{{}, options.revision == SurfelRevision::current};
  o.options.near = options.near;
  for (std::size_t c = 0; c < 3; ++c) o.options.background[c] = options.background[c];
  if (options.mirror) o.options.mirror = Eigen::Vector3f((*options.mirror).data()).cast<double>();
  return o;
}

void expect_surfels_like_reference(Context& ctx, const Gaussians& g, const Camera& cam, const RenderOptions& options) {
  const ref::SurfelFrame want = ref::render_surfels(g, cam, reference_of(options));
  const Picture got = render_picture(ctx, upload(ctx, g), cam, options);
  EXPECT_TRUE(test::close_but_for_flips(got.colour.data, want.colour)) << "colour";
  EXPECT_TRUE(test::close_but_for_flips(got.alpha.data, want.alpha)) << "alpha";
  EXPECT_TRUE(test::close_but_for_flips(got.depth.data, want.depth)) << "depth";
  EXPECT_TRUE(test::close_but_for_flips(got.normal.data, want.normal)) << "normal";
  EXPECT_TRUE(test::close_but_for_flips(got.distortion.data, want.distortion, 1e-3)) << "distortion";
  // (The median jumps by as much as its own value.)
  std::size_t off = 0;
  for (std::size_t i = 0; i < want.median.size(); ++i)
    off += !(std::abs(got.median.data[i] - want.median[i]) <= 1e-4 * (1 + want.median[i]));
  EXPECT_LE(static_cast<double>(off), 1 + 1e-3 * static_cast<double>(want.median.size())) << "median";
}

TEST_P(RenderSurfels, MatchesReference) {
  for (const SceneCase& c : test::scene_cases()) {
    if (c.count > 1000) continue;
    for (const bool current : {false, true}) {
      // Near its horizon a plane is drawn by the current revision with an error as large as the value.
      if (current && (c.kind == "near" || c.kind == "large")) continue;
      SCOPED_TRACE(c.name + (current ? ", current" : ""));
      expect_surfels_like_reference(ctx(), test::make_surfels(c, 1), test::make_camera(c, 1), all_maps(current));
    }
  }
}

TEST_P(RenderSurfels, ObeysNearPlaneAndMirrorsTheCameraForColours) {
  const SceneCase c{"", 200, 3, 40, 40, ""};
  RenderOptions options = all_maps();
  options.near = 1.5f;
  options.mirror = {0.1f, -0.2f, 0.3f};
  expect_surfels_like_reference(ctx(), test::make_surfels(c, 5), test::make_camera(c, 5), options);
}

TEST_P(RenderSurfels, MapsAreOfSurfelsAlone) {
  const SceneCase c{"", 20, 1, 20, 20, ""};
  const Camera cam = test::make_camera(c, 6);
  EXPECT_THROW(render(ctx(), upload(ctx(), test::make_scene(c, 6)), cam, all_maps()), Error);
  const Picture plain = render_picture(ctx(), upload(ctx(), test::make_surfels(c, 6)), cam, {});
  EXPECT_TRUE(plain.normal.empty() && plain.median.empty() && plain.distortion.empty());
  EXPECT_FALSE(plain.colour.empty() || plain.depth.empty());
}

// However little memory there is, the maps have the same bits, whether drawn in parts or uploaded in chunks.
TEST_P(RenderSurfels, DrawsInPartsWhatDoesNotFit) {
  const SceneCase c{"", 150000, 0, 300, 200, ""};
  const Gaussians g = test::make_surfels(c, 12);
  const Camera cam = test::make_camera(c, 12);
  const Picture want = render_picture(ctx(), upload(ctx(), g), cam, all_maps());
  for (const double gib : {0.08, 0.018}) {
    ContextOptions options;
    options.max_memory_gib = gib;
    const auto small = test::open_context(GetParam(), options);
    const GaussianChunks scene = place_on_device(*small, g, 300 * 200);
    int parts = 0;
    for_each_part(*small, scene, cam, all_maps(), false,
                  [&](Context& on, const Part&, const Projected&, const Binned&) { parts += !on.planning(); });
    EXPECT_EQ(parts > 1, gib < 0.02) << gib;
    EXPECT_EQ(scene.chunks() > 1, gib < 0.02) << gib;
    test::expect_same(render_picture(*small, scene, cam, all_maps()), want);
    EXPECT_LE(static_cast<double>(small->memory().peak()), gib * (1 << 30));
  }
}

// The plan predicts the memory of a run with several cameras, on a device that has not been used before.
TEST_P(RenderSurfels, PlansWhatItTakes) {
  const SceneCase c{"", 30000, 1, 200, 160, ""};
  const Gaussians g = test::make_surfels(c, 13);
  ContextOptions options;
  options.max_memory_gib = 0.012;
  const auto counting = test::open_context(GetParam(), options), drawing = test::open_context(GetParam(), options);
  const auto plan = counting->planner();
  const GaussianChunks planned = place_on_device(*plan, g, 200 * 160);
  const GaussianChunks scene = place_on_device(*counting, g, 200 * 160),
                       drawn = place_on_device(*drawing, g, 200 * 160);
  for (std::uint32_t seed = 0; seed < 3; ++seed) {
    const Camera cam = test::make_camera(c, seed);
    plan_render(*counting, scene, *plan, planned, cam, all_maps());
    render(*drawing, drawn, cam, all_maps());
  }
  EXPECT_EQ(plan->memory().peak(), drawing->memory().peak());
}

// Random cotangents of a picture, for all maps that have gradients.
struct Cotangent {
  Cotangent(Context& ctx, int width, int height, std::uint32_t seed = 41) {
    const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    colour = test::random_floats(3 * pixels, seed), alpha = test::random_floats(pixels, seed + 1);
    depth = test::random_floats(pixels, seed + 2), normal = test::random_floats(3 * pixels, seed + 3);
    distortion = test::random_floats(pixels, seed + 4, -30.0f, 30.0f);
    const long h = height, w = width;
    gradient = {ctx.upload({h, w, 3}, colour), ctx.upload({h, w}, alpha), ctx.upload({h, w}, depth),
                ctx.upload({h, w, 3}, normal), ctx.upload({h, w}, distortion)};
  }
  double loss(const ref::SurfelFrame& f) const {
    return ref::weighed(f.colour, colour) + ref::weighed(f.alpha, alpha) + ref::weighed(f.depth, depth) +
           ref::weighed(f.normal, normal) + ref::weighed(f.distortion, distortion);
  }
  std::vector<float> colour, alpha, depth, normal, distortion;
  PictureGradient gradient;
};

struct SurfelsGradient {
  Gaussians gaussians;
  std::array<double, 6> pose{};
};

SurfelsGradient differentiate(Context& ctx, const GaussianChunks& scene, const Camera& cam,
                              const RenderOptions& options, const PictureGradient& by) {
  const SceneGradient out = zero_gradient(ctx, scene);
  SurfelsGradient result;
  render_backward(ctx, scene, cam, options, by, out, &result.pose);
  result.gaussians = download(ctx, out, scene.sh_degree);
  return result;
}

// Compared with differences of the reference's maps in double. Every surfel is visible in every pixel, faces the
// camera, is faint, and stays far from the switch to the low-pass filter: no threshold is near.
TEST_P(RenderSurfels, MatchesDifferences) {
  Gaussians g;
  g.kind = GaussianKind::surfel;
  g.count = 5;
  g.sh_degree = 2;
  const std::vector<float> at = test::random_floats(1000, 44);
  const Camera cam = test::make_camera({"", 0, 0, 13, 11, ""}, 45);
  const Eigen::Quaterniond towards(cam.w2c.topLeftCorner<3, 3>().transpose());
  for (std::size_t k = 0; k < g.count; ++k) {
    const float* r = &at[60 * k];
    const Eigen::Vector3d mean = cam.centre() + towards * Eigen::Vector3d(1.5 + 0.1 * r[0], 1.5 + 0.1 * r[1],
                                                                          1.5 + 0.1 * static_cast<double>(k));
    for (int i = 0; i < 3; ++i) g.means.push_back(static_cast<float>(mean[i]));
    g.scales.insert(g.scales.end(), {1.5f + 0.2f * r[3], 1.5f + 0.2f * r[4]});
    const Eigen::Quaterniond q = towards * Eigen::Quaterniond(1, 0.1 * r[5], 0.1 * r[6], r[7]);
    for (const double v : {q.w(), q.x(), q.y(), q.z()}) g.quats.push_back(static_cast<float>(v));
    g.opacities.push_back(0.4f + 0.2f * r[9]);
    for (std::size_t i = 0; i < 27; ++i) g.sh.push_back(0.2f * r[10 + i] + (i < 3 ? 0.8f : 0.0f));
  }
  for (const bool current : {false, true}) {
    SCOPED_TRACE(current ? "current" : "lara");
    RenderOptions options = all_maps(current);
    options.mirror = {0.1f, -0.2f, 0.3f};
    const ref::SurfelOptions reference = reference_of(options);
    const Cotangent by(ctx(), cam.width, cam.height);
    const auto loss = [&](const Gaussians& scene, const Camera& camera) {
      return by.loss(ref::render_surfels(scene, camera, reference));
    };
    const SurfelsGradient got = differentiate(ctx(), upload(ctx(), g), cam, options, by.gradient);
    test::expect_differences(got.gaussians, got.pose, g, cam, 0x1p-10f, loss);
  }
}

// Surfels seen edge-on, up to the last bit of a float: rounding differences between the two projections make no
// gradient infinite. Such a surfel is drawn by the low-pass filter only, without its plane.
TEST_P(RenderSurfels, SeenEdgeOnHasFiniteGradients) {
  Gaussians g;
  g.kind = GaussianKind::surfel;
  g.count = 20000;
  const Camera cam = test::make_camera({"", 0, 0, 48, 48, ""}, 48);
  const std::vector<float> at = test::random_floats(6 * g.count, 49);
  for (std::size_t k = 0; k < g.count; ++k) {
    const float* r = &at[6 * k];
    const Eigen::Vector3f mean = 0.4f * Eigen::Vector3f(r[0], r[1], r[2]);
    const Eigen::Vector3d ray = (mean.cast<double>() - cam.centre()).normalized();
    // The normal is perpendicular to the ray, in any direction about it.
    const Eigen::Quaterniond q = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitX(), ray) *
                                 Eigen::Quaterniond(Eigen::AngleAxisd(3.0 * r[3], Eigen::Vector3d::UnitX()));
    g.means.insert(g.means.end(), {mean.x(), mean.y(), mean.z()});
    g.scales.insert(g.scales.end(), {0.02f + 0.01f * r[4], 0.02f});
    for (const double v : {q.w(), q.x(), q.y(), q.z()}) g.quats.push_back(static_cast<float>(v));
    g.opacities.push_back(0.05f);
    g.sh.insert(g.sh.end(), {0.5f, 0.2f, r[5]});
  }
  for (const bool current : {false, true}) {
    SCOPED_TRACE(current ? "current" : "lara");
    const SurfelsGradient got = differentiate(ctx(), upload(ctx(), g), cam, all_maps(current),
                                              Cotangent(ctx(), cam.width, cam.height).gradient);
    const auto finite = [](const std::vector<float>& values) {
      return std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
    };
    EXPECT_TRUE(finite(got.gaussians.means)) << "means";
    EXPECT_TRUE(finite(got.gaussians.scales)) << "scales";
    EXPECT_TRUE(finite(got.gaussians.quats)) << "quats";
    const auto seen = std::count_if(got.gaussians.opacities.begin(), got.gaussians.opacities.end(),
                                    [](float v) { return v != 0.0f; });
    // The current revision takes the depth from the plane, and leaves out such a surfel.
    EXPECT_GT(seen, current ? 0 : 10000);
  }
}

// In parts, if memory is short, sums are computed in another order, which is the only difference allowed; chunks change
// nothing.
TEST_P(RenderSurfels, DifferentiatesInPartsAndChunks) {
  const SceneCase c{"", 70000, 1, 200, 120, ""};
  const Gaussians g = test::make_surfels(c, 47);
  const Camera cam = test::make_camera(c, 47);
  const SurfelsGradient want =
      differentiate(ctx(), upload(ctx(), g), cam, {}, Cotangent(ctx(), cam.width, cam.height).gradient);
  const GaussianChunks chunks = test::in_chunks(g);
  ASSERT_EQ(chunks.chunks(), 2);
  const SurfelsGradient same = differentiate(ctx(), chunks, cam, {}, Cotangent(ctx(), cam.width, cam.height).gradient);
  test::expect_close(same.gaussians, want.gaussians, 0);
  EXPECT_EQ(same.pose, want.pose);
  ContextOptions few;
  few.max_memory_gib = 0.04;
  const auto small = test::open_context(GetParam(), few);
  const SurfelsGradient got =
      differentiate(*small, upload(*small, g), cam, {}, Cotangent(*small, cam.width, cam.height).gradient);
  test::expect_close(got.gaussians, want.gaussians, 2e-5);
  EXPECT_LE(static_cast<double>(small->memory().peak()), few.max_memory_gib * (1 << 30));
}

// Drawn once or twice: the same gradients, for a loss that depends on the maps.
TEST_P(RenderSurfels, AlongWithThePictureIsTheSame) {
  const SceneCase c{"", 400, 1, 61, 40, ""};
  const Camera cam = test::make_camera(c, 12);
  const GaussianChunks scene = upload(ctx(), test::make_surfels(c, 12));
  const auto loss = [](Context& on, const DevicePicture& picture) {
    const auto copy = [&on](const Tensor& map) {
      const Tensor out = on.tensor(map.shape());
      on.copy(map, out);
      return out;
    };
    return PictureGradient{
        copy(picture.colour), {}, copy(picture.depth), copy(picture.normal), copy(picture.distortion)};
  };
  const SceneGradient want = zero_gradient(ctx(), scene), got = zero_gradient(ctx(), scene);
  render_backward(ctx(), scene, cam, all_maps(), loss(ctx(), render(ctx(), scene, cam, all_maps())), want, nullptr);
  render_with_backward(ctx(), scene, cam, all_maps(), loss, got);
  test::expect_close(download(ctx(), got, 1), download(ctx(), want, 1), 0);
}

VSPLAT_FLAVOURS(RenderSurfels);

}  // namespace
}  // namespace vsplat
