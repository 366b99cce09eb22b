#include "model/ops/render/project_surfels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/cases/check_projection.h"
#include "model/diagnose/selftest/inputs/random_scenes.h"
#include "model/diagnose/selftest/inputs/surfel_blending.h"
#include "model/ops/render/project.h"

namespace vsplat::selftest {
namespace {

void project_surfels_backward_all(Checks& c) {
  for (const bool current : {false, true})
    for (const SceneCase& s : {SceneCase{"", 17, 1, 50, 37, ""}, {"", 65, 3, 64, 48, ""}})
      check_projection(c, make_surfels(s, 31), make_camera(s, 31), ref::SurfelOptions{{}, current});
  if (!c.all) return;
  for (const SceneCase& s : scene_cases())
    for (const bool current : {false, true})
      if (s.kind != "near" && s.kind != "needles" && s.count <= 1000)
        check_projection(c, make_surfels(s, 31), make_camera(s, 31), ref::SurfelOptions{{}, current});
  const SceneCase s{"", 60, 3, 64, 64, ""};
  Gaussians g = make_surfels(s, 33);
  lengthen_quats(g, 0.03125f, 16);
  ref::SurfelOptions mirrored;
  mirrored.options.mirror = Eigen::Vector3d(0.5, -1, 0.25);
  check_projection(c, g, make_camera(s, 33), mirrored);
}

// Within the reference's tiles, and with its reaches all of the pixels in which it can be seen.
bool right_reach(const ref::Surfel& s, const ref::SurfelOptions& o, std::uint32_t x, std::uint32_t y, const float* r) {
  const int x0 = static_cast<int>(x & 0xffff), x1 = static_cast<int>(x >> 16);
  const int y0 = static_cast<int>(y & 0xffff), y1 = static_cast<int>(y >> 16);
  for (int py = 16 * s.y0; py < 16 * s.y1; ++py)
    for (int px = 16 * s.x0; px < 16 * s.x1; ++px) {
      if (ref::meet(s, px + 0.5, py + 0.5, o).alpha <= 1.001 / 255) continue;
      if (px / 16 < x0 || px / 16 >= x1 || py / 16 < y0 || py / 16 >= y1) return false;
      if (r && (!(std::abs(r[0] - px - 0.5f) <= r[15]) || !(std::abs(r[1] - py - 0.5f) <= r[19]))) return false;
    }
  return y == 0 || (x1 > x0 && y1 > y0 && x0 >= s.x0 && x1 <= s.x1 && y0 >= s.y0 && y1 <= s.y1);
}

// The largest error of a record's numbers, each by what floats leave of it.
double surfel_error(const ref::Surfel& want, const float* r, std::uint32_t key, double focal) {
  const std::array<double, 20> w = ref::record_of(want);
  double worst = 0;
  const auto near = [&](std::size_t i, double allowed) {
    const double error = std::abs(r[i] - w[i]) / allowed;
    worst = std::isfinite(error) ? std::max(worst, error) : INFINITY;
  };
  for (const std::size_t i : {0, 1}) near(i, 1e-6 * (focal + std::abs(w[i])) * std::max(1.0, std::abs(w[i]) / focal));
  near(2, 1e-5);
  near(3, 1e-6 * (1 + w[3]));
  // Seen nearly edge on, the plane is not known better than its normal is.
  const double loose = 3e-6 * (1 + 1 / std::abs(want.facing)) * (1 + 1 / w[3]);
  for (const std::size_t first : {4, 6, 8})
    for (const std::size_t i : {first, first + 1}) near(i, loose * std::hypot(w[first], w[first + 1]));
  const double box = std::hypot(w[10], w[11]);
  for (std::size_t i = 10; box < 100 && i < 12; ++i) near(i, 1e-4 + 1e-4 * box);
  for (std::size_t i = 12; i < 15; ++i) near(i, 3e-6 * (1 + std::abs(w[i])));
  for (std::size_t i = 16; i < 19; ++i) near(i, 2e-6);
  float z;
  std::memcpy(&z, &key, 4);
  return z == r[3] ? worst : INFINITY;
}

void project_surfels_of(Checks& c, const Gaussians& g, const Camera& cam, const ref::SurfelOptions& o,
                        bool chunks = false) {
  const Camera other = look_at({9, 9, 9}, {0, 0, 0}, {0, 1, 0}, 5, 5, 5);
  const Tensor views = upload_views(c.ctx, {other, cam}, static_cast<float>(o.options.near), mirror_of(o.options));
  const long k = static_cast<long>(g.count);
  const DeviceGaussians d = upload(c.ctx, g);
  const Culled culled{c.up({k, 2}, std::vector<std::uint32_t>(2 * g.count, 0xdeadbeef)), c.ctx.tensor({k}, Type::u32),
                      Tensor()};
  project_surfels_cull(c.ctx, d, 0, views, 1, cam.width, cam.height, revision_of(o), culled);
  const auto rects = c.ctx.read<std::uint32_t>(culled.rects), keys = c.ctx.read<std::uint32_t>(culled.keys);
  bool right = true;
  std::vector<std::uint32_t> ids;
  for (std::size_t i = 0; i < g.count; ++i) {
    const ref::Surfel want = ref::project_surfel(g, i, cam, o);
    const bool out = want.culled || want.opacity < 1.0f / 255;
    right = right && (out ? rects[2 * i] == 0 && rects[2 * i + 1] == 0
                          : right_reach(want, o, rects[2 * i], rects[2 * i + 1], nullptr));
    if (rects[2 * i + 1] != 0) ids.push_back(static_cast<std::uint32_t>(i));
  }
  c.that("tiles", right);
  if (!right || ids.empty()) return;
  const long n = static_cast<long>(ids.size()), first = n / 3;
  const Tensor records = c.gap({n, 20}), seen = c.up({n}, ids);
  project_surfels_forward(c.ctx, {d, 0, views, 1, seen, 0, first, records, revision_of(o)});
  project_surfels_forward(c.ctx, {d, 0, views, 1, seen, first, n - first, records, revision_of(o)});
  const auto got = c.ctx.read<float>(records);
  double worst = 0;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const ref::Surfel want = ref::project_surfel(g, ids[i], cam, o);
    const std::size_t at = 2 * std::size_t{ids[i]};
    const bool reaches = right_reach(want, o, rects[at], rects[at + 1], &got[20 * i]);
    worst =
        std::max(worst, reaches ? surfel_error(want, &got[20 * i], keys[ids[i]], std::max(cam.fx, cam.fy)) : INFINITY);
  }
  c.that("records", worst <= 1, worst, 1);
  if (!chunks) return;
  check_chunks(
      c, g, 20, rects, ids, got,
      [&](const DeviceGaussians& chunk, long base, const Culled& out) {
        project_surfels_cull(c.ctx, chunk, base, views, 1, cam.width, cam.height, revision_of(o), out);
      },
      [&](const DeviceGaussians& chunk, long base, const Tensor& every, long from, long count, const Tensor& out) {
        project_surfels_forward(c.ctx, {chunk, base, views, 1, every, from, count, out, revision_of(o)});
      });
}

void project_surfels_all(Checks& c) {
  std::vector<SceneCase> scenes = scene_cases();
  if (c.all)
    for (const std::size_t count : {3, 16, 33}) scenes.push_back({"few", count, 1, 50, 37, ""});
  for (const SceneCase& s : scenes)
    if (c.all || (s.count > 0 && s.count <= (c.quick ? 200 : 1000)))
      for (const bool current : {false, true})
        project_surfels_of(c, make_surfels(s, 21), make_camera(s, 21), {{}, current});
  if (!c.all) return;
  const SceneCase s{"", 100, 2, 64, 64, ""};
  Gaussians g = make_surfels(s, 22);
  lengthen_quats(g, 0.2f);
  ref::SurfelOptions o;
  o.options.mirror = Eigen::Vector3d(0.5, -1, 0.25);
  o.options.near = 1.5f;
  project_surfels_of(c, g, make_camera(s, 22), o);
  const SceneCase in_chunks{"", 101, 2, 64, 64, ""};
  project_surfels_of(c, make_surfels(in_chunks, 25), make_camera(in_chunks, 25), {}, true);
}

}  // namespace

VSPLAT_CASES(project_surfels, {"project_surfels", project_surfels_all},
             {"project_surfels_backward", project_surfels_backward_all})

}  // namespace vsplat::selftest
