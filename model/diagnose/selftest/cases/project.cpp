#include "model/ops/render/project.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/cases/check_projection.h"
#include "model/diagnose/selftest/inputs/random_scenes.h"
#include "model/diagnose/selftest/reference/splat.h"

namespace vsplat::selftest {
namespace {

// Whether any pixel of tile (tx, ty) gets alpha >= 1/255, by a margin.
bool touches(const ref::Splat& s, int tx, int ty) {
  const double det = s.a * s.c - s.b * s.b;
  for (int y = 16 * ty; y < 16 * ty + 16; ++y)
    for (int x = 16 * tx; x < 16 * tx + 16; ++x) {
      const double dx = s.u - (x + 0.5), dy = s.v - (y + 0.5);
      const double power = -0.5 * (s.c * dx * dx + s.a * dy * dy) / det + s.b * dx * dy / det;
      if (s.opacity * std::exp(power) > 1.001 / 255) return true;
    }
  return false;
}

// Within the reference's tiles, and all of those in which it can be seen.
bool right_tiles(const ref::Splat& want, std::uint32_t x, std::uint32_t y) {
  if (want.culled || want.opacity < 1.0f / 255) return x == 0 && y == 0;
  const int x0 = static_cast<int>(x & 0xffff), x1 = static_cast<int>(x >> 16);
  const int y0 = static_cast<int>(y & 0xffff), y1 = static_cast<int>(y >> 16);
  for (int ty = want.y0; ty < want.y1; ++ty)
    for (int tx = want.x0; tx < want.x1; ++tx)
      if ((tx < x0 || tx >= x1 || ty < y0 || ty >= y1) && touches(want, tx, ty)) return false;
  return y == 0 || (x1 > x0 && y1 > y0 && x0 >= want.x0 && x1 <= want.x1 && y0 >= want.y0 && y1 <= want.y1);
}

// The largest error of a record's numbers, each by what floats leave of it.
double record_error(const ref::Splat& want, const float* r, std::uint32_t key, double focal) {
  const double det = want.a * want.c - want.b * want.b, log2e = 1 / std::log(2.0);
  double worst = 0;
  const auto near = [&](double got, double expected, double allowed) {
    const double error = std::abs(got - expected) / allowed;
    worst = std::isfinite(error) ? std::max(worst, error) : INFINITY;
  };
  near(r[0], want.u, 1e-6 * (focal + std::abs(want.u)) * std::max(1.0, std::abs(want.u) / focal));
  near(r[1], want.v, 1e-6 * (focal + std::abs(want.v)) * std::max(1.0, std::abs(want.v) / focal));
  near(r[3], want.z, 1e-6 * (1 + want.z));
  near(r[4], std::log2(want.opacity), 1e-5 + 4e-7 * want.edge_on);
  near(r[5], want.b / want.a, 3e-6 * std::sqrt(want.c / want.a));
  near(r[6] * want.a / log2e, -0.5, 3e-6);
  near(r[7] * det / want.a / log2e, -0.5, 1e-5);
  for (int c = 0; c < 3; ++c) near(r[8 + c], want.colour[c], 3e-6 * (1 + std::abs(want.colour[c])));
  float z;
  std::memcpy(&z, &key, 4);
  return z == r[3] ? worst : INFINITY;
}

void project_of(Checks& c, const Gaussians& g, const Camera& cam, const ref::Options& options, bool chunks = false) {
  const Camera other = look_at({9, 9, 9}, {0, 0, 0}, {0, 1, 0}, 5, 5, 5);
  const Tensor views = upload_views(c.ctx, {other, cam}, 0.2f, mirror_of(options));
  const long k = static_cast<long>(g.count);
  const DeviceGaussians d = upload(c.ctx, g);
  const Culled culled{c.up({k, 2}, std::vector<std::uint32_t>(2 * g.count, 0xdeadbeef)), c.ctx.tensor({k}, Type::u32),
                      Tensor()};
  project_cull(c.ctx, d, 0, views, 1, cam.width, cam.height, culled, options.antialias);
  const auto rects = c.ctx.read<std::uint32_t>(culled.rects), keys = c.ctx.read<std::uint32_t>(culled.keys);
  bool right = true;
  std::vector<std::uint32_t> ids;
  for (std::size_t i = 0; i < g.count; ++i) {
    right = right && right_tiles(ref::project(g, i, cam, options), rects[2 * i], rects[2 * i + 1]);
    if (rects[2 * i + 1] != 0) ids.push_back(static_cast<std::uint32_t>(i));
  }
  c.that("tiles", right);
  if (ids.empty() || !right) return;
  const long n = static_cast<long>(ids.size()), first = n / 3;
  const Tensor seen = c.up({n}, ids), records = c.gap({n, 12});
  project_forward(c.ctx, {d, 0, views, 1, seen, 0, first, records, options.antialias});
  project_forward(c.ctx, {d, 0, views, 1, seen, first, n - first, records, options.antialias});
  const auto got = c.ctx.read<float>(records);
  double worst = 0;
  for (std::size_t i = 0; i < ids.size(); ++i)
    worst = std::max(worst, record_error(ref::project(g, ids[i], cam, options), &got[12 * i], keys[ids[i]],
                                         std::max(cam.fx, cam.fy)));
  c.that("records", worst <= 1, worst, 1);
  if (!chunks) return;
  check_chunks(
      c, g, 12, rects, ids, got,
      [&](const DeviceGaussians& chunk, long base, const Culled& out) {
        project_cull(c.ctx, chunk, base, views, 1, cam.width, cam.height, out, options.antialias);
      },
      [&](const DeviceGaussians& chunk, long base, const Tensor& every, long from, long count, const Tensor& out) {
        project_forward(c.ctx, {chunk, base, views, 1, every, from, count, out, options.antialias});
      });
}

void project_all(Checks& c) {
  for (const SceneCase& s : scene_cases())
    if ((s.count > 0 || c.all) && !(c.quick && (s.count > 300 || s.kind == "discs")))
      for (const bool antialias : {false, true})
        project_of(c, make_scene(s, 21), make_camera(s, 21), {.antialias = antialias});
  if (!c.all) return;
  const SceneCase mirrored{"", 100, 2, 64, 64, ""}, long_quats{"", 60, 0, 64, 64, ""};
  project_of(c, make_scene(mirrored, 22), make_camera(mirrored, 22), {.mirror = Eigen::Vector3d(0.5, -1, 0.25)});
  Gaussians g = make_scene(long_quats, 23);
  lengthen_quats(g, 1);
  project_of(c, g, make_camera(long_quats, 23), {});
  const SceneCase in_chunks{"", 101, 2, 64, 64, ""};
  project_of(c, make_scene(in_chunks, 25), make_camera(in_chunks, 25), {}, true);
}

void project_backward_all(Checks& c) {
  for (const SceneCase& s : {SceneCase{"", 17, 1, 50, 37, ""},
                             {"", 120, 3, 64, 48, ""},
                             {"", 65, 2, 61, 97, "off-centre"},
                             {"", 63, 0, 96, 96, "needles"}})
    for (const bool antialias : {false, true})
      if (!c.quick || s.count < 70)
        check_projection(c, make_scene(s, 31), make_camera(s, 31), {}, {.antialias = antialias});
  if (c.all) {
    for (const SceneCase& s : scene_cases())
      for (const bool antialias : {false, true})
        check_projection(c, make_scene(s, 31), make_camera(s, 31), {}, {.antialias = antialias});
    const SceneCase mirrored{"", 100, 3, 64, 64, ""}, any_length{"", 60, 0, 64, 64, ""};
    check_projection(c, make_scene(mirrored, 32), make_camera(mirrored, 32), {},
                     {.mirror = Eigen::Vector3d(0.5, -1, 0.25)});
    Gaussians g = make_scene(any_length, 33);
    lengthen_quats(g, 0.125f);
    check_projection(c, g, make_camera(any_length, 33), {});
  }
  // Sums of the rows that were written, into the scene's own Gaussians; what no pixel sees stays.
  const std::vector<std::uint32_t> ids = {4, 0, 6}, offsets = {0, 3, 3, 5};
  std::vector<float> rows = random_floats(10, 1, 0, 1);
  rows[2] = rows[3] = NAN;
  const auto before = random_floats(14, 2, 0, 1);
  ProjectPulls a;
  a.visible.ids = c.up({3}, ids), a.offsets = c.up({4}, offsets);
  a.intersections = {c.up({5, 2}, rows), c.ctx.upload({5}, std::vector<std::uint8_t>{1, 0, 1, 1, 1}, Type::u8)};
  a.by_u = 3, a.by_v = 0.5, a.pulls = c.up({7, 2}, before);
  project_pulls(c.ctx, a);
  std::vector<double> want(before.begin(), before.end()), lengths;
  for (const std::size_t r : {0u, 2u}) want[8] += 3.0 * rows[2 * r], want[9] += 0.5 * rows[2 * r + 1];
  for (const std::size_t r : {3u, 4u}) want[12] += 3.0 * rows[2 * r], want[13] += 0.5 * rows[2 * r + 1];
  c.close("pulls", a.pulls, want, 1e-6);
  for (std::size_t k = 0; k < 7; ++k) lengths.push_back(std::hypot(want[2 * k], want[2 * k + 1]));
  c.close("lengths of pulls", pull_lengths(c.ctx, a.pulls), lengths, 1e-6);
}

}  // namespace

VSPLAT_CASES(project, {"project", project_all}, {"project_backward", project_backward_all})

}  // namespace vsplat::selftest
