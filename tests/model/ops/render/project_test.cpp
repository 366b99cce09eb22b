#include "model/ops/render/project.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "model/diagnose/selftest/reference/splat.h"
#include "tests/support/operation.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

class Project : public test::FlavourTest {};

// By the scene's indices; records of those that are seen alone.
struct ProjectResult {
  std::vector<float> records;
  std::vector<std::uint32_t> rects, keys;
};

ProjectResult run_project(Context& ctx, const Gaussians& g, const Camera& cam,
                          const std::optional<std::array<float, 3>>& mirror = {}) {
  const Tensor views =
      upload_views(ctx, {Camera(test::look_at({9, 9, 9}, {0, 0, 0}, {0, 1, 0}, 5, 5, 5)), cam}, 0.2f, mirror);
  const long k = static_cast<long>(g.count);
  const DeviceGaussians d = upload(ctx, g);
  const Culled culled{ctx.upload({k, 2}, std::vector<std::uint32_t>(2 * g.count, 0xdeadbeef), Type::u32),
                      ctx.tensor({k}, Type::u32), Tensor()};
  project_cull(ctx, d, 0, views, 1, cam.width, cam.height, culled);
  ProjectResult out{std::vector<float>(12 * g.count, NAN), ctx.read<std::uint32_t>(culled.rects),
                    ctx.read<std::uint32_t>(culled.keys)};
  std::vector<std::uint32_t> ids;
  for (std::uint32_t i = 0; i < g.count; ++i)
    if (out.rects[2 * i + 1] != 0) ids.push_back(i);
  // In two launches, the second of which begins in the middle of nowhere.
  const long n = static_cast<long>(ids.size()), first = n / 3;
  const Tensor on_device = ctx.upload({n}, ids, Type::u32);
  const Tensor records = ctx.upload({n, 12}, std::vector<float>(12 * ids.size(), NAN));
  project_forward(ctx, {d, 0, views, 1, on_device, 0, first, records});
  project_forward(ctx, {d, 0, views, 1, on_device, first, n - first, records});
  const auto got = ctx.read<float>(records);
  for (std::size_t v = 0; v < ids.size(); ++v)
    std::copy_n(got.begin() + static_cast<std::ptrdiff_t>(12 * v), 12,
                out.records.begin() + 12 * std::ptrdiff_t{ids[v]});
  return out;
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

void check_project(const ref::Splat& want, const ProjectResult& got, std::size_t k, double focal) {
  const std::uint32_t x = got.rects[2 * k], y = got.rects[2 * k + 1];
  if (want.culled || want.opacity < 1.0f / 255) {
    EXPECT_EQ(x, 0u);
    EXPECT_EQ(y, 0u);
    return;
  }
  const bool drawn = y != 0;
  const int x0 = static_cast<int>(x & 0xffff), x1 = static_cast<int>(x >> 16);
  const int y0 = static_cast<int>(y & 0xffff), y1 = static_cast<int>(y >> 16);
  EXPECT_EQ(drawn, x1 > x0 && y1 > y0);
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
    const ProjectResult got = run_project(ctx(), g, cam);
    for (std::size_t k = 0; k < g.count; ++k) {
      SCOPED_TRACE(c.name + ", Gaussian " + std::to_string(k));
      check_project(ref::project(g, k, cam, {}), got, k, std::max(cam.fx, cam.fy));
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
  const ProjectResult got = run_project(ctx(), g, cam, std::array<float, 3>{0.5f, -1, 0.25f});
  for (std::size_t k = 0; k < g.count; ++k) check_project(ref::project(g, k, cam, options), got, k, cam.fx);
}

TEST_P(Project, TakesQuaternionsOfAnyLength) {
  const test::SceneCase c{"", 60, 0, 64, 64, ""};
  Gaussians g = test::make_scene(c, 23);
  for (std::size_t i = 0; i < g.quats.size(); ++i) {
    const std::size_t gaussian = i / 4;
    g.quats[i] *= static_cast<float>(1 + gaussian);
  }
  const Camera cam = test::make_camera(c, 23);
  const ProjectResult got = run_project(ctx(), g, cam);
  for (std::size_t k = 0; k < g.count; ++k) check_project(ref::project(g, k, cam, {}), got, k, cam.fx);
}

// A chunk of a larger scene is projected as the whole of it is, wherever it begins and however many it has.
TEST_P(Project, TakesTheSceneInChunks) {
  const test::SceneCase c{"", 101, 2, 64, 64, ""};
  const Gaussians g = test::make_scene(c, 25);
  const Camera cam = test::make_camera(c, 25);
  const ProjectResult whole = run_project(ctx(), g, cam);
  const Tensor views = upload_views(ctx(), {cam}, 0.2f, {});
  const Culled culled{ctx().tensor({101, 2}, Type::u32), ctx().tensor({101}, Type::u32), Tensor()};
  std::vector<std::uint32_t> ids(101);
  std::iota(ids.begin(), ids.end(), 0u);
  const Tensor on_device = ctx().upload({101}, ids, Type::u32), records = ctx().tensor({101, 12});
  const auto part = [](const std::vector<float>& all, long each, long first, long n) {
    return std::vector<float>(all.begin() + each * first, all.begin() + each * (first + n));
  };
  long first = 0;
  for (const long n : {0L, 1L, 3L, 15L, 16L, 17L, 49L}) {
    const DeviceGaussians chunk{
        ctx().upload({n, 3}, part(g.means, 3, first, n)), ctx().upload({n, 3}, part(g.scales, 3, first, n)),
        ctx().upload({n, 4}, part(g.quats, 4, first, n)), ctx().upload({n}, part(g.opacities, 1, first, n)),
        ctx().upload({n, 9, 3}, part(g.sh, 27, first, n))};
    project_cull(ctx(), chunk, first, views, 0, cam.width, cam.height, culled);
    project_forward(ctx(), {chunk, first, views, 0, on_device, first, n, records});
    first += n;
  }
  ASSERT_EQ(first, 101);
  EXPECT_EQ(ctx().read<std::uint32_t>(culled.rects), whole.rects);
  const auto got = ctx().read<float>(records);
  for (std::size_t i = 0; i < got.size(); ++i) {
    if (whole.rects[2 * (i / 12) + 1] == 0) continue;
    EXPECT_EQ(got[i], whole.records[i]) << i;
  }
}

TEST_P(Project, RejectsBadShape) {
  const test::SceneCase c{"", 4, 1, 32, 32, ""};
  DeviceGaussians g = upload(ctx(), test::make_scene(c, 24));
  const Tensor views = upload_views(ctx(), {test::make_camera(c, 24)}, 0.2f, {});
  const Culled culled{ctx().tensor({4, 2}, Type::u32), ctx().tensor({4}, Type::u32), Tensor()};
  EXPECT_THROW(project_cull(ctx(), g, 0, views, 1, 32, 32, culled), Error);
  EXPECT_THROW(project_cull(ctx(), g, 1, views, 0, 32, 32, culled), Error);
  EXPECT_THROW(project_cull(ctx(), g, 0, views, 0, 2000000, 32, culled), Error);
  const Tensor ids = ctx().tensor({4}, Type::u32), records = ctx().tensor({4, 12});
  EXPECT_THROW(project_forward(ctx(), {g, 0, views, 0, ids, 1, 4, records}), Error);
  g.scales = ctx().tensor({5, 3});
  EXPECT_THROW(project_forward(ctx(), {g, 0, views, 0, ids, 0, 4, records}), Error);
  g.scales = ctx().tensor({4, 3});
  g.sh = ctx().tensor({4, 5, 3});
  EXPECT_THROW(project_cull(ctx(), g, 0, views, 0, 32, 32, culled), Error);
}

VSPLAT_FLAVOURS(Project);
VSPLAT_OPERATION(Project, project)

}  // namespace
}  // namespace vsplat
