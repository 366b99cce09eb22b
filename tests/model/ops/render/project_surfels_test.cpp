#include "model/ops/render/project_surfels.h"

#include <gtest/gtest.h>

#include <cmath>
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
  const Tensor views = upload_views(ctx, {Camera(test::look_at({9, 9, 9}, {0, 0, 0}, {0, 1, 0}, 5, 5, 5)), cam},
                                    static_cast<float>(o.options.near), {});
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
