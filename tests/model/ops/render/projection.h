// A scene of volumes or of surfels, projected whole and in chunks.
#pragma once
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "model/diagnose/selftest/inputs/random_scenes.h"
#include "model/ops/render/project_surfels.h"

namespace vsplat::test {

// By the scene's indices; records of those that are seen alone.
struct Projection {
  std::vector<float> records;
  std::vector<std::uint32_t> rects;
};

inline void cull(Context& ctx, const DeviceGaussians& g, long base, const Tensor& views, long view, const Camera& cam,
                 const Culled& out, SurfelRevision revision = SurfelRevision::lara) {
  if (g.kind() == GaussianKind::surfel)
    project_surfels_cull(ctx, g, base, views, view, cam.width, cam.height, revision, out);
  else
    project_cull(ctx, g, base, views, view, cam.width, cam.height, out);
}

inline void project(Context& ctx, const ProjectForward& a, SurfelRevision revision = SurfelRevision::lara) {
  if (a.chunk.kind() == GaussianKind::surfel)
    project_surfels_forward(ctx, {a.chunk, a.base, a.views, a.view, a.ids, a.from, a.n, a.records, revision});
  else
    project_forward(ctx, a);
}

inline Projection projected(Context& ctx, const Gaussians& g, const Camera& cam,
                            SurfelRevision revision = SurfelRevision::lara) {
  const Camera other = selftest::look_at({9, 9, 9}, {0, 0, 0}, {0, 1, 0}, 5, 5, 5);
  const Tensor views = upload_views(ctx, {other, cam}, 0.2f, {});
  const long k = static_cast<long>(g.count), record = g.kind == GaussianKind::surfel ? kSurfelRecord : kRecord;
  const DeviceGaussians d = upload(ctx, g);
  const Culled culled{ctx.upload({k, 2}, std::vector<std::uint32_t>(2 * g.count, 0xdeadbeef), Type::u32),
                      ctx.tensor({k}, Type::u32), Tensor()};
  cull(ctx, d, 0, views, 1, cam, culled, revision);
  Projection out{std::vector<float>(static_cast<std::size_t>(record * k), NAN), ctx.read<std::uint32_t>(culled.rects)};
  std::vector<std::uint32_t> ids;
  for (std::uint32_t i = 0; i < g.count; ++i)
    if (out.rects[2 * i + 1] != 0) ids.push_back(i);
  // In two launches, the second of which begins in the middle of nowhere.
  const long n = static_cast<long>(ids.size()), first = n / 3;
  const Tensor on_device = ctx.upload({n}, ids, Type::u32);
  const Tensor records = ctx.upload({n, record}, std::vector<float>(static_cast<std::size_t>(record * n), NAN));
  project(ctx, {d, 0, views, 1, on_device, 0, first, records}, revision);
  project(ctx, {d, 0, views, 1, on_device, first, n - first, records}, revision);
  const auto got = ctx.read<float>(records);
  for (long v = 0; v < n; ++v)
    std::copy_n(got.begin() + record * v, record, out.records.begin() + record * std::ptrdiff_t{ids[v]});
  return out;
}

// A chunk of a larger scene is projected as the whole of it is, wherever it begins and however many it has.
inline void expect_chunks_like_whole(Context& ctx, const Gaussians& g, const Camera& cam) {
  const Projection whole = projected(ctx, g, cam);
  const long k = static_cast<long>(g.count), record = g.kind == GaussianKind::surfel ? kSurfelRecord : kRecord;
  const Tensor views = upload_views(ctx, {cam}, 0.2f, {});
  const Culled culled{ctx.tensor({k, 2}, Type::u32), ctx.tensor({k}, Type::u32), Tensor()};
  std::vector<std::uint32_t> ids(g.count);
  std::iota(ids.begin(), ids.end(), 0u);
  const Tensor on_device = ctx.upload({k}, ids, Type::u32), records = ctx.tensor({k, record});
  long first = 0;
  for (const long n : {0L, 1L, 3L, 15L, 16L, 17L, 49L}) {
    const DeviceGaussians chunk = upload(ctx, g, first, n);
    cull(ctx, chunk, first, views, 0, cam, culled);
    project(ctx, {chunk, first, views, 0, on_device, first, n, records});
    first += n;
  }
  ASSERT_EQ(first, k);
  EXPECT_EQ(ctx.read<std::uint32_t>(culled.rects), whole.rects);
  const auto got = ctx.read<float>(records);
  for (std::size_t i = 0; i < got.size(); ++i) {
    if (whole.rects[2 * (i / static_cast<std::size_t>(record)) + 1] == 0) continue;
    EXPECT_EQ(got[i], whole.records[i]) << i;
  }
}

}  // namespace vsplat::test
