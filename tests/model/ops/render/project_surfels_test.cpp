#include "model/ops/render/project_surfels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "model/diagnose/selftest/reference/surfels.h"
#include "tests/support/operation.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

class ProjectSurfels : public test::FlavourTest {};

SurfelRevision revision_of(const ref::SurfelOptions& o) {
  return o.current ? SurfelRevision::current : SurfelRevision::lara;
}

// By the scene's indices; records of those that are seen alone.
struct ProjectSurfelsResult {
  std::vector<float> records;
  std::vector<std::uint32_t> rects, keys;
};

ProjectSurfelsResult run_project_surfels(Context& ctx, const Gaussians& g, const Camera& cam,
                                         const ref::SurfelOptions& o = {}) {
  std::optional<std::array<float, 3>> mirror;
  if (o.options.mirror) {
    const Eigen::Vector3f m = o.options.mirror->cast<float>();
    mirror = {m.x(), m.y(), m.z()};
  }
  const Tensor views = upload_views(ctx, {Camera(test::look_at({9, 9, 9}, {0, 0, 0}, {0, 1, 0}, 5, 5, 5)), cam},
                                    static_cast<float>(o.options.near), mirror);
  const long k = static_cast<long>(g.count);
  const DeviceGaussians d = upload(ctx, g);
  const Culled culled{ctx.upload({k, 2}, std::vector<std::uint32_t>(2 * g.count, 0xdeadbeef), Type::u32),
                      ctx.tensor({k}, Type::u32), Tensor()};
  project_surfels_cull(ctx, d, 0, views, 1, cam.width, cam.height, revision_of(o), culled);
  ProjectSurfelsResult out{std::vector<float>(20 * g.count, NAN), ctx.read<std::uint32_t>(culled.rects),
                           ctx.read<std::uint32_t>(culled.keys)};
  std::vector<std::uint32_t> ids;
  for (std::uint32_t i = 0; i < g.count; ++i)
    if (out.rects[2 * i + 1] != 0) ids.push_back(i);
  // In two launches, the second of which begins in the middle of nowhere.
  const long n = static_cast<long>(ids.size()), first = n / 3;
  const Tensor on_device = ctx.upload({n}, ids, Type::u32);
  const Tensor records = ctx.upload({n, 20}, std::vector<float>(20 * ids.size(), NAN));
  project_surfels_forward(ctx, {d, 0, views, 1, on_device, 0, first, records, revision_of(o)});
  project_surfels_forward(ctx, {d, 0, views, 1, on_device, first, n - first, records, revision_of(o)});
  const auto got = ctx.read<float>(records);
  for (std::size_t v = 0; v < ids.size(); ++v)
    std::copy_n(got.begin() + static_cast<std::ptrdiff_t>(20 * v), 20,
                out.records.begin() + 20 * std::ptrdiff_t{ids[v]});
  return out;
}

// The pixels of the reference's tiles that a surfel is seen in, by a margin.
template <class Work>
void for_each_seen(const ref::Surfel& s, const ref::SurfelOptions& o, const Work& work) {
  for (int y = 16 * s.y0; y < 16 * s.y1; ++y)
    for (int x = 16 * s.x0; x < 16 * s.x1; ++x)
      if (ref::meet(s, x + 0.5, y + 0.5, o).alpha > 1.001 / 255) work(x, y);
}

void check_project_surfels(const ref::Surfel& want, const ProjectSurfelsResult& got, std::size_t k, double focal,
                           const ref::SurfelOptions& o) {
  const std::uint32_t x = got.rects[2 * k], y = got.rects[2 * k + 1];
  if (want.culled || want.opacity < 1.0f / 255) {
    EXPECT_EQ(x, 0u);
    EXPECT_EQ(y, 0u);
    return;
  }
  const int x0 = static_cast<int>(x & 0xffff), x1 = static_cast<int>(x >> 16);
  const int y0 = static_cast<int>(y & 0xffff), y1 = static_cast<int>(y >> 16);
  EXPECT_EQ(y != 0, x1 > x0 && y1 > y0);
  // Within the reference's tiles and the reaches is all that can be seen.
  const float* r = &got.records[20 * k];
  int lost = 0;
  for_each_seen(want, o, [&](int px, int py) {
    lost += px / 16 < x0 || px / 16 >= x1 || py / 16 < y0 || py / 16 >= y1 || !(std::abs(r[0] - px - 0.5f) <= r[15]) ||
            !(std::abs(r[1] - py - 0.5f) <= r[19]);
  });
  EXPECT_EQ(lost, 0);
  if (y == 0) return;
  EXPECT_TRUE(x0 >= want.x0 && x1 <= want.x1 && y0 >= want.y0 && y1 <= want.y1);
  const std::array<double, 20> w = ref::record_of(want);
  for (int i = 0; i < 2; ++i)
    EXPECT_NEAR(r[i], w[i], 1e-6 * (focal + std::abs(w[i])) * std::max(1.0, std::abs(w[i]) / focal));
  EXPECT_NEAR(r[2], w[2], 1e-5);
  EXPECT_NEAR(r[3], w[3], 1e-6 * (1 + w[3]));
  // Seen nearly edge on, the plane is not known better than its normal is.
  const double loose = 3e-6 * (1 + 1 / std::abs(want.facing)) * (1 + 1 / w[3]);
  for (const std::size_t first : {4, 6, 8}) {
    const double size = std::hypot(w[first], w[first + 1]);
    for (const std::size_t i : {first, first + 1}) EXPECT_NEAR(r[i], w[i], loose * size) << "number " << i;
  }
  // (Towards the camera's plane the box has no end.)
  const double box = std::hypot(w[10], w[11]);
  if (box < 100) {
    for (const std::size_t i : {std::size_t{10}, std::size_t{11}}) EXPECT_NEAR(r[i], w[i], 1e-4 + 1e-4 * box) << i;
  }
  for (std::size_t i = 12; i < 15; ++i) EXPECT_NEAR(r[i], w[i], 3e-6 * (1 + std::abs(w[i])));
  for (std::size_t i = 16; i < 19; ++i) EXPECT_NEAR(r[i], w[i], 2e-6);
  float z;
  std::memcpy(&z, &got.keys[k], 4);
  EXPECT_EQ(z, r[3]);
}

TEST_P(ProjectSurfels, MatchesReference) {
  std::vector<test::SceneCase> cases = test::scene_cases();
  for (const std::size_t count : {3, 16, 33}) cases.push_back({"few", count, 1, 50, 37, ""});
  for (const test::SceneCase& c : cases) {
    for (const bool current : {false, true}) {
      const ref::SurfelOptions o{{}, current};
      const Gaussians g = test::make_surfels(c, 21);
      const Camera cam = test::make_camera(c, 21);
      const ProjectSurfelsResult got = run_project_surfels(ctx(), g, cam, o);
      for (std::size_t k = 0; k < g.count; ++k) {
        SCOPED_TRACE(c.name + (current ? ", current" : "") + ", surfel " + std::to_string(k));
        check_project_surfels(ref::project_surfel(g, k, cam, o), got, k, std::max(cam.fx, cam.fy), o);
        if (HasFailure()) return;
      }
    }
  }
}

TEST_P(ProjectSurfels, ObeysMirrorNearPlaneAndLengthOfQuaternions) {
  const test::SceneCase c{"", 100, 2, 64, 64, ""};
  Gaussians g = test::make_surfels(c, 22);
  for (std::size_t i = 0; i < g.quats.size(); ++i) g.quats[i] *= 0.2f * static_cast<float>(1 + i / 4);
  const Camera cam = test::make_camera(c, 22);
  ref::SurfelOptions o;
  o.options.mirror = Eigen::Vector3d(0.5, -1, 0.25);
  o.options.near = 1.5f;
  const ProjectSurfelsResult got = run_project_surfels(ctx(), g, cam, o);
  for (std::size_t k = 0; k < g.count; ++k) check_project_surfels(ref::project_surfel(g, k, cam, o), got, k, cam.fx, o);
}

// Seen edge on, without extent, behind the camera, at the near plane, or no number: left out. What is beside it is not.
TEST_P(ProjectSurfels, LeavesOutWhatCannotBeDrawn) {
  Gaussians g;
  g.kind = GaussianKind::surfel;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<std::vector<float>> surfels = {
      {0, 0, 2, 0.5f, 0.5f, 1, 0, 0, 0},  // faces the camera
      {0, 0, 2, 0.5f, 0.5f, 1, 0, 1, 0},  // its normal is x
      {0, 0, 2, 0, 0.5f, 1, 0, 0, 0},      {0, 0, -2, 0.5f, 0.5f, 1, 0, 0, 0}, {0, 0, 0.2f, 0.5f, 0.5f, 1, 0, 0, 0},
      {nan, 0, 2, 0.5f, 0.5f, 1, 0, 0, 0}, {0, 0, 2, nan, 0.5f, 1, 0, 0, 0},   {0, 0, 2, 0.5f, 0.5f, 1, nan, 0, 0}};
  for (const std::vector<float>& s : surfels) {
    g.means.insert(g.means.end(), s.begin(), s.begin() + 3);
    g.scales.insert(g.scales.end(), s.begin() + 3, s.begin() + 5);
    g.quats.insert(g.quats.end(), s.begin() + 5, s.end());
    g.opacities.push_back(0.5f);
    g.sh.insert(g.sh.end(), {0, 0, 0});
    ++g.count;
  }
  Camera cam;
  cam.width = cam.height = 40;
  cam.fx = cam.fy = 40;
  cam.cx = cam.cy = 20;
  for (const bool current : {false, true}) {
    const ProjectSurfelsResult got = run_project_surfels(ctx(), g, cam, {{}, current});
    for (std::size_t k = 0; k < g.count; ++k) EXPECT_EQ(got.rects[2 * k] != 0, k == 0) << k;
  }
}

// A chunk of a larger scene is projected as the whole of it is, wherever it begins and however many it has.
TEST_P(ProjectSurfels, TakesTheSceneInChunks) {
  const test::SceneCase c{"", 101, 2, 64, 64, ""};
  const Gaussians g = test::make_surfels(c, 25);
  const Camera cam = test::make_camera(c, 25);
  const ProjectSurfelsResult whole = run_project_surfels(ctx(), g, cam);
  const Tensor views = upload_views(ctx(), {cam}, 0.2f, {});
  const Culled culled{ctx().tensor({101, 2}, Type::u32), ctx().tensor({101}, Type::u32), Tensor()};
  std::vector<std::uint32_t> ids(101);
  std::iota(ids.begin(), ids.end(), 0u);
  const Tensor on_device = ctx().upload({101}, ids, Type::u32), records = ctx().tensor({101, 20});
  long first = 0;
  for (const long n : {0L, 1L, 3L, 15L, 16L, 17L, 49L}) {
    const DeviceGaussians chunk = upload(ctx(), g, first, n);
    project_surfels_cull(ctx(), chunk, first, views, 0, cam.width, cam.height, SurfelRevision::lara, culled);
    project_surfels_forward(ctx(), {chunk, first, views, 0, on_device, first, n, records});
    first += n;
  }
  ASSERT_EQ(first, 101);
  EXPECT_EQ(ctx().read<std::uint32_t>(culled.rects), whole.rects);
  const auto got = ctx().read<float>(records);
  for (std::size_t i = 0; i < got.size(); ++i) {
    if (whole.rects[2 * (i / 20) + 1] == 0) continue;
    EXPECT_EQ(got[i], whole.records[i]) << i;
  }
}

TEST_P(ProjectSurfels, RejectsBadShape) {
  const test::SceneCase c{"", 4, 1, 32, 32, ""};
  DeviceGaussians g = upload(ctx(), test::make_surfels(c, 24));
  const Tensor views = upload_views(ctx(), {test::make_camera(c, 24)}, 0.2f, {});
  const Culled culled{ctx().tensor({4, 2}, Type::u32), ctx().tensor({4}, Type::u32), Tensor()};
  const auto cull = [&](long base, long view, int width) {
    project_surfels_cull(ctx(), g, base, views, view, width, 32, SurfelRevision::lara, culled);
  };
  EXPECT_THROW(cull(0, 1, 32), Error);
  EXPECT_THROW(cull(1, 0, 32), Error);
  EXPECT_THROW(cull(0, 0, 2000000), Error);
  EXPECT_THROW(project_cull(ctx(), g, 0, views, 0, 32, 32, culled), Error);
  const Tensor ids = ctx().tensor({4}, Type::u32), records = ctx().tensor({4, 20});
  EXPECT_THROW(project_surfels_forward(ctx(), {g, 0, views, 0, ids, 1, 4, records}), Error);
  EXPECT_THROW(project_surfels_forward(ctx(), {g, 0, views, 0, ids, 0, 4, ctx().tensor({4, 12})}), Error);
  g.scales = ctx().tensor({4, 3});
  EXPECT_THROW(cull(0, 0, 32), Error);
}

VSPLAT_FLAVOURS(ProjectSurfels);
VSPLAT_OPERATION(ProjectSurfels, project_surfels)

}  // namespace
}  // namespace vsplat
