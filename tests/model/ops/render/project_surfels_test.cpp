#include "model/ops/render/project_surfels.h"

#include <gtest/gtest.h>

#include <limits>

#include "model/diagnose/selftest/inputs/random_scenes.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class ProjectSurfels : public test::FlavourTest {};

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
  for (const SurfelRevision revision : {SurfelRevision::lara, SurfelRevision::current}) {
    const Culled culled{ctx().tensor({8, 2}, Type::u32), ctx().tensor({8}, Type::u32), Tensor()};
    const Tensor views = upload_views(ctx(), {cam}, 0.2f, {});
    project_surfels_cull(ctx(), upload(ctx(), g), 0, views, 0, cam.width, cam.height, revision, culled);
    const auto rects = ctx().read<std::uint32_t>(culled.rects);
    for (std::size_t k = 0; k < g.count; ++k) EXPECT_EQ(rects[2 * k] != 0, k == 0) << k;
  }
}

TEST_P(ProjectSurfels, RejectsBadShape) {
  const selftest::SceneCase c{"", 4, 1, 32, 32, ""};
  DeviceGaussians g = upload(ctx(), selftest::make_surfels(c, 24));
  const Tensor views = upload_views(ctx(), {selftest::make_camera(c, 24)}, 0.2f, {});
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
