#include <gtest/gtest.h>

#include "model/diagnose/selftest/inputs/random_scenes.h"
#include "model/ops/render/project.h"
#include "model/ops/render/project_surfels.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

class ProjectBackward : public test::FlavourTest {};

TEST_P(ProjectBackward, RejectsBadShape) {
  const selftest::SceneCase c{"", 4, 1, 32, 32, ""};
  const Tensor views = upload_views(ctx(), {selftest::make_camera(c, 35)}, 0.2f, {});
  for (const GaussianKind kind : {GaussianKind::volume, GaussianKind::surfel}) {
    GaussianGradients out = zero_gradients(ctx(), 4, 1, kind);
    const bool surfels = kind == GaussianKind::surfel;
    const DeviceGaussians g = upload(ctx(), surfels ? selftest::make_surfels(c, 35) : selftest::make_scene(c, 35));
    Projected visible;
    visible.ids = ctx().tensor({2}, Type::u32), visible.records = ctx().tensor({2, surfels ? kSurfelRecord : kRecord});
    Tensor offsets = ctx().tensor({3}, Type::u32);
    const IntersectionGradients rows{ctx().tensor({7, surfels ? 20 : 10}), ctx().tensor({7}, Type::u8)};
    const auto run_with = [&](long view, const Tensor& pose) {
      if (surfels)
        project_surfels_backward(ctx(), {g, 0, views, view, false, visible, offsets, rows, out, pose});
      else
        project_backward(ctx(), {g, 0, views, view, false, visible, offsets, rows, out, pose});
    };
    EXPECT_THROW(run_with(1, Tensor()), Error);
    EXPECT_THROW(run_with(0, ctx().tensor({3, 6})), Error);
    offsets = ctx().tensor({2}, Type::u32);
    EXPECT_THROW(run_with(0, Tensor()), Error);
    offsets = ctx().tensor({3}, Type::u32);
    if (surfels)
      out.scales = ctx().tensor({4, 3});
    else
      out.sh = ctx().tensor({4, 9, 3});
    EXPECT_THROW(run_with(0, Tensor()), Error);
  }
}

TEST_P(ProjectBackward, RejectsBadShapesOfPulls) {
  ProjectPulls pulls;
  pulls.visible.ids = ctx().tensor({3}, Type::u32), pulls.offsets = ctx().tensor({4}, Type::u32);
  pulls.intersections = {ctx().tensor({5, 2}), ctx().tensor({5}, Type::u8)};
  pulls.pulls = ctx().tensor({7, 3});
  EXPECT_THROW(project_pulls(ctx(), pulls), Error);
}

VSPLAT_FLAVOURS(ProjectBackward);

}  // namespace
}  // namespace vsplat
