#include "model/ops/render/project.h"

#include <gtest/gtest.h>

#include "model/diagnose/selftest/inputs/random_scenes.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Project : public test::FlavourTest {};

TEST_P(Project, RejectsBadShape) {
  const selftest::SceneCase c{"", 4, 1, 32, 32, ""};
  DeviceGaussians g = upload(ctx(), selftest::make_scene(c, 24));
  const Tensor views = upload_views(ctx(), {selftest::make_camera(c, 24)}, 0.2f, {});
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
