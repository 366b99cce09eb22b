#include "model/ops/project.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "tests/reference/splat.h"
#include "tests/support/device.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

class Project : public test::FlavourTest {};

struct Result {
  std::vector<float> records;
  std::vector<std::uint32_t> rects, counts, keys;
};

Result run(Context& ctx, const Gaussians& g, const Camera& cam,
           const std::optional<std::array<float, 3>>& mirror = {}) {
  const Tensor views =
      upload_views(ctx, {Camera(test::look_at({9, 9, 9}, {0, 0, 0}, {0, 1, 0}, 5, 5, 5)), cam}, 0.2f, mirror);
  const Projected p = project(ctx, upload(ctx, g), views, 1, cam.width, cam.height);
  return {ctx.read<float>(p.records), ctx.read<std::uint32_t>(p.rects), ctx.read<std::uint32_t>(p.counts),
          ctx.read<std::uint32_t>(p.keys)};
}

// Whether any pixel of tile (tx, ty) gets alpha >= 1/255, by a margin.
bool touches(const ref::Splat& s, int tx, int ty) {
  const double det = s.a * s.c - s.b * s.b;
  for (int y = 16 * ty; y < 16 * ty + 16; ++y) {
    for (int x = 16 * tx; x < 16 * tx + 16; ++x) {
      const double dx = s.u - (x + 0.5), dy = s.v - (y + 0.5);
      const double power = -0.5 * (s.c * dx * dx + s.a * dy * dy) / det + s.b * dx * dy / det;
      if (s.opacity * std::exp(power) > 1.001 / 255) return true;
    }
  }
  return false;
}

void check(const ref::Splat& want, const Result& got, std::size_t k, double focal) {
  const std::uint32_t x = got.rects[2 * k], y = got.rects[2 * k + 1];
  if (want.culled || want.opacity < 1.0f / 255) {
    EXPECT_EQ(got.counts[k], 0u);
    EXPECT_EQ(got.keys[k], 0xffffffffu);
    return;
  }
  const bool drawn = got.counts[k] != 0;
  const int x0 = drawn ? static_cast<int>(x & 0xffff) : 0, x1 = drawn ? static_cast<int>(x >> 16) : 0;
  const int y0 = drawn ? static_cast<int>(y & 0xffff) : 0, y1 = drawn ? static_cast<int>(y >> 16) : 0;
  EXPECT_EQ(got.counts[k], static_cast<unsigned>((x1 - x0) * (y1 - y0)));
  // Within the reference's tiles, and all of those in which it can be seen.
  for (int ty = want.y0; ty < want.y1; ++ty)
    for (int tx = want.x0; tx < want.x1; ++tx)
      if (tx < x0 || tx >= x1 || ty < y0 || ty >= y1) {
        EXPECT_FALSE(touches(want, tx, ty)) << tx << " " << ty;
      }
  if (!drawn) return;
  EXPECT_TRUE(x0 >= want.x0 && x1 <= want.x1 && y0 >= want.y0 && y1 <= want.y1);
  const float* r = &got.records[12 * k];
  const double det = want.a * want.c - want.b * want.b, log2e = 1 / std::log(2.0);
  EXPECT_NEAR(r[0], want.u, 1e-6 * (focal + std::abs(want.u)) * std::max(1.0, std::abs(want.u) / focal));
  EXPECT_NEAR(r[1], want.v, 1e-6 * (focal + std::abs(want.v)) * std::max(1.0, std::abs(want.v) / focal));
  EXPECT_NEAR(r[3], want.z, 1e-6 * (1 + want.z));
  EXPECT_NEAR(r[4], std::log2(want.opacity), 1e-5);
  EXPECT_NEAR(r[5], want.b / want.a, 3e-6 * std::sqrt(want.c / want.a));
  EXPECT_NEAR(r[6] * want.a / log2e, -0.5, 3e-6);
  EXPECT_NEAR(r[7] * det / want.a / log2e, -0.5, 1e-5);  // where a c - b^2 in float would be off by up to 1e-2
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(r[8 + c], want.colour[c], 3e-6 * (1 + std::abs(want.colour[c])));
  float z;
  std::memcpy(&z, &got.keys[k], 4);
  EXPECT_EQ(z, r[3]);
}

TEST_P(Project, MatchesReference) {
  for (const test::SceneCase& c : test::scene_cases()) {
    const Gaussians g = test::make_scene(c, 21);
    const Camera cam = test::make_camera(c, 21);
    const Result got = run(ctx(), g, cam);
    for (std::size_t k = 0; k < g.count; ++k) {
      SCOPED_TRACE(c.name + ", Gaussian " + std::to_string(k));
      check(ref::project(g, k, cam, {}), got, k, std::max(cam.fx, cam.fy));
      if (HasFailure()) return;
    }
  }
}

TEST_P(Project, MirrorsTheCameraForColours) {
  const test::SceneCase c{"", 100, 2, 64, 64, ""};
  const Gaussians g = test::make_scene(c, 22);
  const Camera cam = test::make_camera(c, 22);
  ref::Options options;
  options.mirror = Eigen::Vector3d(0.5, -1, 0.25);
  const Result got = run(ctx(), g, cam, std::array<float, 3>{0.5f, -1, 0.25f});
  for (std::size_t k = 0; k < g.count; ++k) check(ref::project(g, k, cam, options), got, k, cam.fx);
}

TEST_P(Project, TakesQuaternionsOfAnyLength) {
  const test::SceneCase c{"", 60, 0, 64, 64, ""};
  Gaussians g = test::make_scene(c, 23);
  for (std::size_t i = 0; i < g.quats.size(); ++i) g.quats[i] *= static_cast<float>(1 + i / 4);
  const Camera cam = test::make_camera(c, 23);
  const Result got = run(ctx(), g, cam);
  for (std::size_t k = 0; k < g.count; ++k) check(ref::project(g, k, cam, {}), got, k, cam.fx);
}

TEST_P(Project, RejectsBadShape) {
  const test::SceneCase c{"", 4, 1, 32, 32, ""};
  DeviceGaussians g = upload(ctx(), test::make_scene(c, 24));
  const Tensor views = upload_views(ctx(), {test::make_camera(c, 24)}, 0.2f, {});
  EXPECT_THROW(project(ctx(), g, views, 1, 32, 32), Error);
  EXPECT_THROW(project(ctx(), g, views, 0, 2000000, 32), Error);
  g.scales = ctx().tensor({5, 3});
  EXPECT_THROW(project(ctx(), g, views, 0, 32, 32), Error);
  g.scales = ctx().tensor({4, 3});
  g.sh = ctx().tensor({4, 5, 3});
  EXPECT_THROW(project(ctx(), g, views, 0, 32, 32), Error);
}

VSPLAT_FLAVOURS(Project);

}  // namespace
}  // namespace vsplat
