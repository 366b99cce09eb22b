#include "model/render/geometry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <thread>

#include "model/base/scene.h"
#include "runtime/share_out.h"

namespace vsplat {
namespace {

constexpr float kMostAlpha = 0.99f, kLeastAlpha = 1.0f / 255, kLeastLight = 1e-4f;

// The device's results for a part of the picture.
struct SeenPart {
  std::vector<float> records;                        // [V,12], see cl/render/project.cl
  std::vector<std::uint32_t> ids, starts, gaussian;  // record indices sorted by tile; begin of each tile; Gaussian of
                                                     // each record
};

// Median depth and nearest Gaussian of a pixel, from the records of its tile.
void pick_pixel(const SeenPart& seen, std::uint32_t from, std::uint32_t to, float x, float y, float& median,
                std::int32_t& nearest) {
  float light = 1;
  for (std::uint32_t i = from; i < to && light > 0.5f; ++i) {
    const std::size_t id = seen.ids[i];
    const float* r = &seen.records[kRecord * id];
    const float dx = r[0] - x, t = (r[1] - y) - r[5] * dx;
    const float alpha = std::min(std::exp2(r[4] + r[6] * dx * dx + r[7] * t * t), kMostAlpha);
    if (!(alpha >= kLeastAlpha)) continue;
    const float after = light * (1 - alpha);
    if (after < kLeastLight) return;
    if (nearest < 0) nearest = static_cast<std::int32_t>(seen.gaussian[id]);
    median = r[3];
    light = after;
  }
}

}  // namespace

Picks pick(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options) {
  const auto pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  Picks out{std::vector<float>(pixels), std::vector<std::int32_t>(pixels, -1)};
  for_each_part(ctx, scene, camera, options, false,
                [&](Context& c, const Part& part, const Projected& projected, const Binned& binned) {
                  if (c.planning()) return;
                  const SeenPart seen{c.read<float>(projected.records), c.read<std::uint32_t>(binned.ids),
                                      c.read<std::uint32_t>(binned.starts), c.read<std::uint32_t>(projected.ids)};
                  const auto pick_tile = [&](long tile) {
                    const std::uint32_t from = seen.starts[static_cast<std::size_t>(tile)],
                                        to = seen.starts[static_cast<std::size_t>(tile) + 1];
                    const int x0 = (part.x0 + static_cast<int>(tile % part.tiles_x())) * kTile,
                              y0 = (part.y0 + static_cast<int>(tile / part.tiles_x())) * kTile;
                    for (int y = y0; y < std::min(y0 + kTile, camera.height); ++y)
                      for (int x = x0; x < std::min(x0 + kTile, camera.width); ++x) {
                        const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) +
                                        static_cast<std::size_t>(x);
                        pick_pixel(seen, from, to, static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f,
                                   out.median[at], out.ids[at]);
                      }
                  };
                  ShareOut shared;
                  shared.items = static_cast<std::size_t>(part.tiles() / part.tiles_x());  // rows of tiles
                  shared.workers = std::clamp(std::thread::hardware_concurrency(), 1u, 64u);
                  shared.ahead = shared.items;
                  shared.work = [&](std::size_t, std::size_t row) {
                    for (long i = 0; i < part.tiles_x(); ++i) pick_tile(static_cast<long>(row) * part.tiles_x() + i);
                  };
                  share_out(shared);
                });
  return out;
}

Gaussians coloured_by_normals(const Gaussians& gaussians, const Camera& camera) {
  Gaussians out;
  out.count = gaussians.count;
  out.means = gaussians.means;
  out.scales = gaussians.scales;
  out.quats = gaussians.quats;
  out.opacities = gaussians.opacities;
  out.sh.resize(3 * out.count);
  const Eigen::Matrix3d turn = camera.w2c.topLeftCorner<3, 3>();
  const Eigen::Vector3d shift = camera.w2c.topRightCorner<3, 1>();
  for (std::size_t k = 0; k < out.count; ++k) {
    const float *q = &out.quats[4 * k], *s = &out.scales[3 * k];
    const Eigen::Matrix3d axes = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
    Eigen::Vector3d normal = turn * axes.col(std::min_element(s, s + 3) - s);
    const Eigen::Vector3d mean = Eigen::Map<const Eigen::Vector3f>(&out.means[3 * k]).cast<double>();
    if (normal.dot(turn * mean + shift) > 0) normal = -normal;
    for (std::size_t c = 0; c < 3; ++c)
      out.sh[3 * k + c] = static_cast<float>(0.5 * normal[static_cast<Eigen::Index>(c)] / kShC0);
  }
  return out;
}

}  // namespace vsplat
