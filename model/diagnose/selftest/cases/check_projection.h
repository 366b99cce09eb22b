// Projection's derivatives, of volumes and of surfels: rows of sums that stand for a loss which is linear in what
// projection makes of each Gaussian, against differences of that loss.
#pragma once
#include <algorithm>
#include <array>
#include <numeric>
#include <optional>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/projection_rows.h"
#include "model/diagnose/selftest/inputs/random_scenes.h"
#include "model/ops/render/project.h"
#include "model/ops/render/project_surfels.h"

namespace vsplat::selftest {

// The camera's mirror, as the device takes it.
inline std::optional<std::array<float, 3>> mirror_of(const ref::Options& options) {
  if (!options.mirror) return {};
  const Eigen::Vector3f m = options.mirror->cast<float>();
  return std::array<float, 3>{m.x(), m.y(), m.z()};
}

// Whether a chunk of a larger scene is projected as the whole of it was, wherever it begins and however many it has.
// cull(chunk, base, out) and project(chunk, base, ids, from, n, records) do it.
template <class Cull, class Project>
void check_chunks(Checks& c, const Gaussians& g, long record, const std::vector<std::uint32_t>& rects,
                  const std::vector<std::uint32_t>& ids, const std::vector<float>& records, const Cull& cull,
                  const Project& project) {
  const long k = static_cast<long>(g.count);
  const Culled culled{c.ctx.tensor({k, 2}, Type::u32), c.ctx.tensor({k}, Type::u32), Tensor()};
  std::vector<std::uint32_t> all(g.count);
  std::iota(all.begin(), all.end(), 0u);
  const Tensor every = c.up({k}, all), out = c.ctx.tensor({k, record});
  long first = 0;
  for (const long size : {0L, 1L, 3L, 15L, 16L, 17L, k}) {
    const long n = std::min(size, k - first);
    const DeviceGaussians chunk = upload(c.ctx, g, first, n);
    cull(chunk, first, culled);
    project(chunk, first, every, first, n, out);
    first += n;
  }
  c.equal("tiles, in chunks", culled.rects, rects);
  const auto got = c.ctx.read<float>(out);
  std::vector<float> seen;
  for (const std::uint32_t id : ids)
    seen.insert(seen.end(), got.begin() + record * id, got.begin() + record * (id + std::ptrdiff_t{1}));
  c.equal("records, in chunks", seen, records);
}

inline void check_projection(Checks& c, const Gaussians& g, const Camera& cam,
                             const std::optional<ref::SurfelOptions>& surfels, const ref::Options& volumes = {}) {
  const ProjectionRows p = surfels ? surfel_rows(g, cam, *surfels) : volume_rows(g, cam, volumes);
  const auto mirror = mirror_of(surfels ? surfels->options : volumes);
  if (p.ids.empty() && !c.all) return;
  const long n = static_cast<long>(p.ids.size()), m = static_cast<long>(p.touched.size()), record = surfels ? 20 : 12,
             columns = surfels ? 20 : 10;
  const Tensor views = upload_views(c.ctx, {look_at({9, 9, 9}, {0, 0, 0}, {0, 1, 0}, 5, 5, 5), cam}, 0.2f, mirror),
               pose_gradients = c.gap({n, 6});
  const DeviceGaussians d = upload(c.ctx, g);
  const GaussianGradients out = zero_gradients(c.ctx, d.count(), g.sh_degree, g.kind);
  Projected visible;
  visible.ids = c.up({n}, p.ids), visible.records = c.up({n, record}, p.records);
  const Tensor offsets = c.up({n + 1}, p.offsets);
  const IntersectionGradients rows{c.up({m, columns}, p.rows), c.ctx.upload({m}, p.touched, Type::u8)};
  const auto run = [&](const DeviceGaussians& chunk, long base, const GaussianGradients& to, const Tensor& pose) {
    if (surfels)
      project_surfels_backward(c.ctx, {chunk, base, views, 1, mirror.has_value(), visible, offsets, rows, to, pose,
                                       surfels->current ? SurfelRevision::current : SurfelRevision::lara});
    else
      project_backward(
          c.ctx, {chunk, base, views, 1, mirror.has_value(), visible, offsets, rows, to, pose, volumes.antialias});
  };
  run(d, 0, out, pose_gradients);
  const std::size_t scales = surfels ? 2 : 3;
  const auto smallest = [&](std::size_t k) {
    return std::min({g.scales[3 * k], g.scales[3 * k + 1], g.scales[3 * k + 2]});
  };
  const auto step_of = [](double step) { return [step](std::size_t, std::size_t) { return step; }; };
  c.close(
      "means", out.means,
      [&] { return by_field(p, g, cam, &Gaussians::means, 3, step_of(surfels ? 0x1p-12 : 0x1p-10)); }, 1e-4);
  c.close(
      "scales", out.scales,
      [&] {
        return by_field(p, g, cam, &Gaussians::scales, scales, [&](std::size_t k, std::size_t j) {
          return (surfels ? 0x1p-7 : 0x1p-6) * static_cast<double>(g.scales[scales * k + j]);
        });
      },
      1e-4);
  c.close(
      "rotations", out.quats,
      [&] {
        return by_field(p, g, cam, &Gaussians::quats, 4, [&](std::size_t k, std::size_t) {
          const float* q = &g.quats[4 * k];
          const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
          return surfels ? 0x1p-12 : length * (smallest(k) < 1e-3f ? 0x1p-10 : 0x1p-8);
        });
      },
      1e-4);
  c.close(
      "opacities", out.opacities,
      [&] {
        return by_field(p, g, cam, &Gaussians::opacities, 1,
                        [&](std::size_t k, std::size_t) { return 0x1p-6 * static_cast<double>(g.opacities[k]); });
      },
      1e-4);
  c.close(
      "harmonics", out.sh, [&] { return by_field(p, g, cam, &Gaussians::sh, 3 * g.sh_count(), step_of(0x1p-8)); },
      1e-4);
  c.close(
      "pose", sum_pose_gradients(c.ctx, pose_gradients), [&] { return by_pose(p, g, cam, surfels ? 0x1p-12 : 1e-3); },
      1e-4);
  if (!c.all) return;
  const Tensor fields[] = {out.means, out.scales, out.quats, out.opacities, out.sh};
  std::vector<std::vector<float>> sums;
  for (const Tensor& field : fields) sums.push_back(c.ctx.read<float>(field));
  // In chunks: the same bits.
  std::vector<std::vector<float>> parts(sums.size());
  const Tensor pose_parts = c.zeros({n, 6});
  const bool few = d.count() <= 120;
  for (long base = 0; few && base < d.count(); base += 17) {
    const long some = std::min(17L, d.count() - base);
    const GaussianGradients part = zero_gradients(c.ctx, some, g.sh_degree, g.kind);
    run(upload(c.ctx, g, base, some), base, part, pose_parts);
    const Tensor of[] = {part.means, part.scales, part.quats, part.opacities, part.sh};
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const auto values = c.ctx.read<float>(of[i]);
      parts[i].insert(parts[i].end(), values.begin(), values.end());
    }
  }
  for (std::size_t i = 0; few && i < parts.size(); ++i) c.equal("in chunks", parts[i], sums[i]);
  if (few)
    c.equal("pose, in chunks", sum_pose_gradients(c.ctx, pose_parts),
            c.ctx.read<float>(sum_pose_gradients(c.ctx, pose_gradients)));
  run(d, 0, out, pose_gradients);  // adds to what is there
  for (std::size_t i = 0; i < sums.size(); ++i) {
    for (float& v : sums[i]) v *= 2;
    if (surfels)
      c.close("added to what is there", fields[i], sums[i], 1e-6);
    else
      c.equal("added to what is there", fields[i], sums[i]);
  }
}

}  // namespace vsplat::selftest
