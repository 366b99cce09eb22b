// Projection's derivatives, of volumes and of surfels: rows of sums that stand for a loss which is linear in what
// projection makes of each Gaussian, against differences of that loss.
#pragma once
#include <algorithm>
#include <optional>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/projection_rows.h"
#include "model/ops/render/project.h"
#include "model/ops/render/project_surfels.h"

namespace vsplat::selftest {

inline void check_projection(Checks& c, const Gaussians& g, const Camera& cam,
                             const std::optional<ref::SurfelOptions>& surfels) {
  const ProjectionRows p = surfels ? surfel_rows(g, cam, *surfels) : volume_rows(g, cam, {});
  if (p.ids.empty()) return;
  const long n = static_cast<long>(p.ids.size()), m = static_cast<long>(p.touched.size()), record = surfels ? 20 : 12,
             columns = surfels ? 20 : 10;
  const Tensor views = upload_views(c.ctx, {cam}, 0.2f, {}), twists = c.gap({n, 6});
  const DeviceGaussians d = upload(c.ctx, g);
  const GaussianGradients out = zero_gradients(c.ctx, d.count(), g.sh_degree, g.kind);
  Projected visible;
  visible.ids = c.up({n}, p.ids), visible.records = c.up({n, record}, p.records);
  const Tensor offsets = c.up({n + 1}, p.offsets);
  const IntersectionGradients rows{c.up({m, columns}, p.rows), c.ctx.upload({m}, p.touched, Type::u8)};
  if (surfels)
    project_surfels_backward(c.ctx, {d, 0, views, 0, false, visible, offsets, rows, out, twists,
                                     surfels->current ? SurfelRevision::current : SurfelRevision::lara});
  else
    project_backward(c.ctx, {d, 0, views, 0, false, visible, offsets, rows, out, twists});
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
          return surfels ? 0x1p-12 : smallest(k) < 1e-3f ? 0x1p-10 : 0x1p-8;
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
      "pose", sum_twists(c.ctx, twists), [&] { return by_pose(p, g, cam, surfels ? 0x1p-12 : 1e-3); }, 1e-4);
}

}  // namespace vsplat::selftest
