#include "model/render/render.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "model/base/scene.h"
#include "model/diagnose/selftest/reference/splat.h"
#include "model/io/scene/ply.h"
#include "tests/support/close_pictures.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/golden_inputs.h"
#include "tests/support/refusal.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using test::SceneCase;

void expect_like_reference(Context& ctx, const Gaussians& g, const Camera& cam, const RenderOptions& options = {}) {
  ref::Options ro;
  ro.near = options.near;
  ro.antialias = options.antialias;
  for (std::size_t c = 0; c < 3; ++c) ro.background[c] = options.background[c];
  if (options.mirror) ro.mirror = Eigen::Vector3d((*options.mirror)[0], (*options.mirror)[1], (*options.mirror)[2]);
  const ref::Frame want = ref::render(g, cam, ro);
  const Picture got = render_picture(ctx, upload(ctx, g), cam, options);
  EXPECT_TRUE(test::close_but_for_flips(got.colour.data, want.colour)) << "colour";
  EXPECT_TRUE(test::close_but_for_flips(got.alpha.data, want.alpha)) << "alpha";
  EXPECT_TRUE(test::close_but_for_flips(got.depth.data, want.depth)) << "depth";
}

class Render : public test::FlavourTest {};

TEST_P(Render, MatchesReference) {
  for (const SceneCase& c : test::scene_cases()) {
    for (std::uint32_t seed = 1; seed <= 2; ++seed) {
      SCOPED_TRACE(c.name + " seed " + std::to_string(seed));
      RenderOptions options;
      options.background = {1, 0.5f, 0};
      options.antialias = seed == 2;
      expect_like_reference(ctx(), test::make_scene(c, seed), test::make_camera(c, seed), options);
    }
  }
}

TEST_P(Render, MirrorsTheCameraForColours) {
  const SceneCase c{"", 200, 3, 40, 40, ""};
  RenderOptions options;
  options.mirror = {0.1f, -0.2f, 0.3f};
  expect_like_reference(ctx(), test::make_scene(c, 5), test::make_camera(c, 5), options);
}

// What is smaller than a pixel gives light in proportion to its area with anti-aliasing, and far more without.
TEST_P(Render, AntialiasedLightFollowsTheSize) {
  Gaussians g;
  g.count = 1;
  g.means = {0, 0, 0}, g.scales = {0.01f, 0.02f, 0.01f}, g.quats = {1, 0, 0, 0}, g.opacities = {0.9f};
  g.sh = {1, 1, 1};
  const auto light = [&](double focal, bool antialias) {
    const Camera cam = test::look_at({0, 0, -2}, {0, 0, 0}, {0, -1, 0}, 32, 32, focal);
    RenderOptions options;
    options.antialias = antialias;
    double sum = 0;
    for (const float a : render_picture(ctx(), upload(ctx(), g), cam, options).alpha.data)
      sum += static_cast<double>(a);
    return sum / (focal * focal);
  };
  // Deviations of 0.2 by 0.4 pixels, and of 0.8 by 1.6. A few percent lie where alpha is below 1/255.
  EXPECT_NEAR(light(40, true) / light(160, true), 1, 0.07);
  EXPECT_GT(light(40, false) / light(160, false), 3);
}

TEST_P(Render, ObeysTheNearPlane) {
  const SceneCase c{"", 200, 1, 40, 40, ""};
  RenderOptions options;
  options.near = 1.5f;
  expect_like_reference(ctx(), test::make_scene(c, 6), test::make_camera(c, 6), options);
}

// Far from the origin, float32 has few digits left for positions, and differences must not lose any more.
TEST_P(Render, IsExactFarFromTheOrigin) {
  const SceneCase c{"", 300, 1, 64, 64, ""};
  Gaussians g = test::make_scene(c, 7);
  Camera cam = test::make_camera(c, 7);
  const Eigen::Vector3d shift(1000, -2000, 3000);
  for (std::size_t i = 0; i < g.means.size(); ++i) g.means[i] += static_cast<float>(shift[static_cast<long>(i % 3)]);
  cam.w2c.topRightCorner<3, 1>() -= cam.w2c.topLeftCorner<3, 3>() * shift;
  expect_like_reference(ctx(), g, cam);
}

TEST_P(Render, GivesTheSameBytesEveryTime) {
  const SceneCase c{"", 3000, 1, 100, 70, ""};
  const Gaussians g = test::make_scene(c, 8);
  const Camera cam = test::make_camera(c, 8);
  const Picture first = render_picture(ctx(), upload(ctx(), g), cam, {});
  for (int i = 0; i < 2; ++i) {
    test::expect_same(render_picture(ctx(), upload(ctx(), g), cam, {}), first);
  }
}

// Equal depths blend in the Gaussians' own order.
TEST_P(Render, BreaksTiesByIndex) {
  Gaussians g;
  g.count = 300;
  for (std::size_t k = 0; k < g.count; ++k) {
    g.means.insert(g.means.end(), {0, 0, 0});
    g.scales.insert(g.scales.end(), {0.2f, 0.2f, 0.2f});
    g.quats.insert(g.quats.end(), {1, 0, 0, 0});
    g.opacities.push_back(0.03f);
    g.sh.insert(g.sh.end(), {static_cast<float>(k % 7) - 1, static_cast<float>(k % 5), static_cast<float>(k) * 0.01f});
  }
  expect_like_reference(ctx(), g, test::make_camera({"", 0, 0, 40, 40, ""}, 9));
}

// Gaussians with values that are not finite or too large are omitted, and affect nothing else.
TEST_P(Render, LeavesOutWhatIsNotFinite) {
  const SceneCase c{"", 50, 1, 40, 40, ""};
  Gaussians g = test::make_scene(c, 10);
  const Camera cam = test::make_camera(c, 10);
  Gaussians broken = g;
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  broken.means[0] = nan;
  broken.means[3] = inf;
  broken.scales[6] = nan;
  broken.scales[9] = inf;
  broken.opacities[4] = nan;
  broken.quats[20] = nan;
  for (std::size_t k = 0; k <= 5; ++k) g.opacities[k] = 0;
  const Picture got = render_picture(ctx(), upload(ctx(), broken), cam, {}),
                want = render_picture(ctx(), upload(ctx(), g), cam, {});
  EXPECT_EQ(got.colour.data, want.colour.data);
}

TEST_P(Render, RefusesCamerasThatCannotBe) {
  const SceneCase c{"", 5, 1, 40, 40, ""};
  const DeviceGaussians g = upload(ctx(), test::make_scene(c, 11));
  const Camera good = test::make_camera(c, 11);
  Camera cam = good;
  cam.w2c(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(render(ctx(), g, cam, {}), Error);
  cam = good;
  cam.fx = 0;
  EXPECT_THROW(render(ctx(), g, cam, {}), Error);
  cam = good;
  cam.width = 0;
  EXPECT_THROW(render(ctx(), g, cam, {}), Error);
  RenderOptions options;
  options.near = -1;
  EXPECT_THROW(render(ctx(), g, good, options), Error);
}

// Tiles that a Gaussian does not reach make no difference: the bits are the same with and without them.
TEST_P(Render, ExactTilesChangeNoBit) {
  for (const SceneCase& c : test::scene_cases()) {
    const DeviceGaussians g = upload(ctx(), test::make_scene(c, 31));
    const Camera cam = test::make_camera(c, 31);
    RenderOptions options;
    const Picture want = render_picture(ctx(), g, cam, options);
    options.exact_tiles = true;
    SCOPED_TRACE(c.name);
    test::expect_same(render_picture(ctx(), g, cam, options), want);
  }
}

// However little memory there is, the picture has the same bits, whether drawn in parts or uploaded in chunks.
TEST_P(Render, DrawsInPartsWhatDoesNotFit) {
  const SceneCase c{"", 150000, 0, 300, 200, ""};
  const Gaussians g = test::make_scene(c, 12);
  const Camera cam = test::make_camera(c, 12);
  const Picture want = render_picture(ctx(), upload(ctx(), g), cam, {});
  for (const double gib : {0.06, 0.016, 0.0115}) {
    ContextOptions options;
    options.max_memory_gib = gib;
    const auto small = test::open_context(GetParam(), options);
    const GaussianChunks scene = place_on_device(*small, g, 300 * 200);
    int parts = 0;
    for_each_part(*small, scene, cam, {}, false,
                  [&](Context& on, const Part&, const Projected&, const Binned&) { parts += !on.planning(); });
    EXPECT_EQ(parts > 1, gib < 0.02) << gib;
    EXPECT_EQ(scene.chunks() > 1, gib < 0.02) << gib;
    test::expect_same(render_picture(*small, scene, cam, {}), want);
    EXPECT_LE(static_cast<double>(small->memory().peak()), gib * (1 << 30));
  }
}

TEST_P(Render, RefusesWhatNoPartFitsOf) {
  const SceneCase c{"", 20000, 0, 64, 64, "cluster"};
  const Gaussians g = test::make_scene(c, 12);
  Camera cam = test::make_camera(c, 12);
  cam.fx = cam.fy = 4;  // everything is within one tile
  ContextOptions options;
  options.max_memory_gib = 0.001;
  const auto small = test::open_context(GetParam(), options);
  test::expect_error(Status::memory, {}, [&] { render(*small, place_on_device(*small, g, 64 * 64), cam, {}); });
}

// The plan predicts the memory of a run with several cameras, on a device that has not been used before.
TEST_P(Render, PlansWhatItTakes) {
  const SceneCase c{"", 30000, 1, 200, 160, ""};
  const Gaussians g = test::make_scene(c, 13);
  for (const double gib : {0.0, 0.009}) {
    ContextOptions options;
    options.max_memory_gib = gib;
    const auto counting = test::open_context(GetParam(), options), drawing = test::open_context(GetParam(), options);
    const auto plan = counting->planner();
    const GaussianChunks planned = place_on_device(*plan, g, 200 * 160);
    const GaussianChunks scene = place_on_device(*counting, g, 200 * 160),
                         drawn = place_on_device(*drawing, g, 200 * 160);
    for (std::uint32_t seed = 0; seed < 5; ++seed) {
      Camera cam = test::make_camera(c, seed);
      cam.fx = cam.fy *= 1.0 + 0.3 * seed;
      plan_render(*counting, scene, *plan, planned, cam, {});
      render(*drawing, drawn, cam, {});
    }
    EXPECT_EQ(plan->memory().peak(), drawing->memory().peak()) << gib;
  }
}

// A scene moved together with its camera gives the same picture: positions, sizes, rotations and colours are
// transformed.
TEST_P(Render, MovesWithItsCamera) {
  const SceneCase c{"", 400, 3, 64, 48, ""};
  Scene scene;
  scene.gaussians = test::make_scene(c, 14);
  scene.mirror = {0.1f, 0.2f, -0.1f};
  Camera cam = test::make_camera(c, 14);
  const auto draw = [&] {
    RenderOptions options;
    options.near = scene.near;
    options.mirror = scene.mirror;
    return render_picture(ctx(), upload(ctx(), scene.gaussians), cam, options);
  };
  const Picture before = draw();
  Similarity move;
  move.scale = 2.5;
  move.rotation = Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized().toRotationMatrix();
  move.translation = {0.4, -1, 3};
  transform(scene, move);
  const Eigen::Vector3d centre = move.scale * (move.rotation * cam.centre()) + move.translation;
  cam.w2c.topLeftCorner<3, 3>() = Eigen::Matrix3d(cam.w2c.topLeftCorner<3, 3>() * move.rotation.transpose());
  cam.w2c.topRightCorner<3, 1>() = -cam.w2c.topLeftCorner<3, 3>() * centre;
  const Picture after = draw();
  double square = 0;
  for (std::size_t i = 0; i < before.colour.data.size(); ++i)
    square += std::pow(before.colour.data[i] - after.colour.data[i], 2);
  EXPECT_LT(square / static_cast<double>(before.colour.data.size()), 1e-8);  // 80 dB
}

// Written, read and drawn again: the same picture, up to the rounding of logarithms.
TEST_P(Render, SurvivesThePly) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "scene.ply";
  for (const char* kind : {"", "opacity", "needles"}) {
    const SceneCase c{"", 400, 3, 64, 48, kind};
    Scene scene;
    scene.gaussians = test::make_scene(c, 15);
    const Camera cam = test::make_camera(c, 15);
    write_ply(path, scene);
    const Picture before = render_picture(ctx(), upload(ctx(), scene.gaussians), cam, {});
    const Picture after = render_picture(ctx(), upload(ctx(), read_ply(path).gaussians), cam, {});
    double square = 0;
    for (std::size_t i = 0; i < before.colour.data.size(); ++i)
      square += std::pow(before.colour.data[i] - after.colour.data[i], 2);
    EXPECT_LT(square / static_cast<double>(before.colour.data.size()), 1e-6) << kind;  // 60 dB
  }
}

// Draws the specification's own Gaussians, and compares with its pictures.
TEST_P(Render, MatchesTheSpecificationsPictures) {
  for (const std::string& name : test::golden_present()) {
    SCOPED_TRACE(name);
    const test::Golden golden = test::Golden::load(name);
    const std::vector<Camera> cameras = test::golden_cameras(golden);
    const std::vector<float> background = golden.floats("input.background");
    RenderOptions options;
    std::copy(background.begin(), background.end(), options.background.begin());
    if (golden.config().negate_camera_centre) options.mirror = std::array<float, 3>{0, 0, 0};
    for (const std::string level : {"coarse", "final"}) {
      const DeviceGaussians g = test::golden_gaussians(ctx(), golden, "stage." + level);
      std::vector<float> colour, alpha, depth;
      for (const Camera& cam : cameras) {
        const Picture p = render_picture(ctx(), g, cam, options);
        colour.insert(colour.end(), p.colour.data.begin(), p.colour.data.end());
        alpha.insert(alpha.end(), p.alpha.data.begin(), p.alpha.data.end());
        depth.insert(depth.end(), p.depth.data.begin(), p.depth.data.end());
      }
      // The file has pictures of more views than the network's input.
      const auto want = [&](const char* part, std::size_t count) {
        std::vector<double> all = test::as_doubles(golden.floats("render." + level + "." + part));
        EXPECT_GE(all.size(), count);
        all.resize(count);
        return all;
      };
      EXPECT_TRUE(test::close_but_for_flips(colour, want("image", colour.size()))) << "colour, " << level;
      EXPECT_TRUE(test::close_but_for_flips(alpha, want("alpha", alpha.size()))) << "alpha, " << level;
      EXPECT_TRUE(test::close_but_for_flips(depth, want("depth", depth.size()))) << "depth, " << level;
    }
  }
}

VSPLAT_FLAVOURS(Render);

}  // namespace
}  // namespace vsplat
