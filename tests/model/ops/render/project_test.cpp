#include "model/ops/render/project.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

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

ProjectResult run_project(Context& ctx, const Gaussians& g, const Camera& cam) {
  const Tensor views =
      upload_views(ctx, {Camera(test::look_at({9, 9, 9}, {0, 0, 0}, {0, 1, 0}, 5, 5, 5)), cam}, 0.2f, {});
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
