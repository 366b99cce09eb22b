// Gaussians to pictures, and blending's derivative; that of projection is in projections.cpp.
#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>
#include <tuple>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/random_scenes.h"
#include "model/diagnose/selftest/inputs/records.h"
#include "model/diagnose/selftest/reference/rasterize.h"
#include "model/diagnose/selftest/reference/rasterize_backward.h"
#include "model/diagnose/selftest/reference/splat.h"
#include "model/ops/render/project.h"
#include "model/ops/render/rasterize.h"
#include "model/ops/render/tile_bin.h"
#include "model/ops/render/visible.h"

namespace vsplat::selftest {
namespace {

std::size_t draw_size(long a, long b = 1) { return static_cast<std::size_t>(a * b); }

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
  near(r[4], std::log2(want.opacity), 1e-5);
  near(r[5], want.b / want.a, 3e-6 * std::sqrt(want.c / want.a));
  near(r[6] * want.a / log2e, -0.5, 3e-6);
  near(r[7] * det / want.a / log2e, -0.5, 1e-5);
  for (int c = 0; c < 3; ++c) near(r[8 + c], want.colour[c], 3e-6 * (1 + std::abs(want.colour[c])));
  float z;
  std::memcpy(&z, &key, 4);
  return z == r[3] ? worst : INFINITY;
}

void project_all(Checks& c) {
  for (const SceneCase& s : scene_cases()) {
    if (s.count == 0 || (c.quick && (s.count > 300 || s.kind == "discs"))) continue;
    const Gaussians g = make_scene(s, 21);
    const Camera cam = make_camera(s, 21);
    const Tensor views = upload_views(c.ctx, {cam}, 0.2f, {});
    const long k = static_cast<long>(g.count);
    const DeviceGaussians d = upload(c.ctx, g);
    const Culled culled{c.up({k, 2}, std::vector<std::uint32_t>(2 * g.count, 0xdeadbeef)), c.ctx.tensor({k}, Type::u32),
                        Tensor()};
    project_cull(c.ctx, d, 0, views, 0, cam.width, cam.height, culled);
    const auto rects = c.ctx.read<std::uint32_t>(culled.rects), keys = c.ctx.read<std::uint32_t>(culled.keys);
    bool right = true;
    std::vector<std::uint32_t> ids;
    for (std::uint32_t i = 0; i < g.count; ++i) {
      right =
          right && right_tiles(ref::project(g, i, cam, {}), rects[2 * std::size_t{i}], rects[2 * std::size_t{i} + 1]);
      if (rects[2 * std::size_t{i} + 1] != 0) ids.push_back(i);
    }
    c.that("tiles", right);
    if (ids.empty() || !right) continue;
    const long n = static_cast<long>(ids.size()), first = n / 3;
    const Tensor seen = c.up({n}, ids), records = c.gap({n, 12});
    project_forward(c.ctx, {d, 0, views, 0, seen, 0, first, records});
    project_forward(c.ctx, {d, 0, views, 0, seen, first, n - first, records});
    const auto got = c.ctx.read<float>(records);
    double worst = 0;
    for (std::size_t i = 0; i < ids.size(); ++i)
      worst = std::max(
          worst, record_error(ref::project(g, ids[i], cam, {}), &got[12 * i], keys[ids[i]], std::max(cam.fx, cam.fy)));
    c.that("records", worst <= 1, worst, 1);
  }
}

void visible_all(Checks& c) {
  for (const long n : c.some({1L, 3L, 15L, 16L, 17L, 1023L, 1024L, 1025L, 40000L}))
    for (const Part& part : {Part{0, 0, 60, 40}, Part{17, 11, 18, 12}, Part{30, 20, 60, 40}}) {
      std::mt19937 engine(static_cast<unsigned>(n));
      std::vector<std::uint32_t> rects, keys, ids, within, order;
      std::uint64_t pairs = 0;
      for (std::uint32_t k = 0; k < n; ++k) {
        const std::uint32_t x = engine() % 60, y = engine() % 40, w = 1 + engine() % 5, h = 1 + engine() % 4;
        const bool culled = k > 0 && engine() % 4 == 0;
        rects.push_back(culled ? 0 : x | std::min(x + w, 60u) << 16);
        rects.push_back(culled ? 0 : y | std::min(y + h, 40u) << 16);
        keys.push_back(0x3f800000u + engine() % 100000);
        const auto clipped = [](std::uint32_t r, int from, int to) {
          return std::pair{std::max(static_cast<int>(r & 0xffff), from) - from,
                           std::min(static_cast<int>(r >> 16), to) - from};
        };
        const auto [l, r] = clipped(rects[2 * std::size_t{k}], part.x0, part.x1);
        const auto [t, b] = clipped(rects[2 * std::size_t{k} + 1], part.y0, part.y1);
        if (l >= r || t >= b) continue;
        ids.push_back(k), order.push_back(keys.back());
        within.push_back(static_cast<unsigned>(l) | static_cast<unsigned>(r) << 16);
        within.push_back(static_cast<unsigned>(t) | static_cast<unsigned>(b) << 16);
        pairs += draw_size(r - l, b - t);
      }
      const std::uint32_t least = order.empty() ? 0 : *std::min_element(order.begin(), order.end());
      for (auto& key : order) key -= least;
      const Culled culled = make_culled(c.ctx, n);
      c.ctx.write(culled.rects, rects.data());
      c.ctx.write(culled.keys, keys.data());
      const VisibleCount count = count_visible(c.ctx, culled, part);
      bool right = count.gaussians == ids.size() && count.intersections == pairs && count.least_key == least;
      for (std::size_t b = 0; b < count.before.size(); ++b)
        right = right && count.before[b] ==
                             static_cast<std::uint64_t>(
                                 std::lower_bound(ids.begin(), ids.end(), b * draw_size(count.block)) - ids.begin());
      c.that("counts", right);
      if (!right || ids.empty()) continue;
      const Projected got = compact_visible(c.ctx, culled, part, count);
      c.equal("indices", got.ids, ids);
      c.equal("tiles", got.rects, within);
      c.equal("depths", got.keys, order);
    }
}

void tile_bin_of(Checks& c, long count, int tiles_x, int tiles_y) {
  std::mt19937 engine(static_cast<std::uint32_t>(count));
  std::vector<std::uint32_t> rects, keys, order(draw_size(count)), ids, starts, offsets{0}, slots;
  for (long k = 0; k < count; ++k) {
    std::uint32_t x0 = engine() % static_cast<unsigned>(tiles_x), x1 = engine() % static_cast<unsigned>(tiles_x);
    std::uint32_t y0 = engine() % static_cast<unsigned>(tiles_y), y1 = engine() % static_cast<unsigned>(tiles_y);
    if (x0 > x1) std::swap(x0, x1);
    if (y0 > y1) std::swap(y0, y1);
    x1 = std::min(x1 + 1, x0 + (k % 2 ? 2u : 4u));
    y1 = std::min(y1 + 1, y0 + (k % 2 ? 2u : 3u));
    rects.push_back(x0 | x1 << 16), rects.push_back(y0 | y1 << 16);
    offsets.push_back(offsets.back() + (x1 - x0) * (y1 - y0));
    keys.push_back(engine() % 50);
  }
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return keys[a] < keys[b]; });
  std::vector<std::uint32_t> next = offsets;
  for (std::uint32_t ty = 0; ty < static_cast<unsigned>(tiles_y); ++ty)
    for (std::uint32_t tx = 0; tx < static_cast<unsigned>(tiles_x); ++tx) {
      starts.push_back(static_cast<std::uint32_t>(ids.size()));
      for (const std::size_t k : order) {
        const std::uint32_t x = rects[2 * k], y = rects[2 * k + 1];
        if (tx < (x & 0xffff) || tx >= x >> 16 || ty < (y & 0xffff) || ty >= y >> 16) continue;
        ids.push_back(static_cast<std::uint32_t>(k));
        slots.push_back(next[k]++);
      }
    }
  starts.push_back(static_cast<std::uint32_t>(ids.size()));
  for (const bool with_slots : {false, true}) {
    Projected p;
    p.rects = c.up({count, 2}, rects), p.keys = c.up({count}, keys), p.key_bits = 6;
    const Binned got = tile_bin(c.ctx, p, ids.size(), {3, 5, 3 + tiles_x, 5 + tiles_y}, {with_slots, false});
    c.equal("who is in a tile", got.ids, ids);
    c.equal("tiles' runs", got.starts, starts);
    if (!with_slots) continue;
    c.equal("Gaussians' runs", got.offsets, offsets);
    c.equal("slots", got.slots, slots);
  }
}

// With the exact test a tile is left out where no pixel of it has alpha >= 1/255, and nowhere else.
void tile_bin_exact(Checks& c) {
  std::mt19937 engine(5);
  std::uniform_real_distribution<float> uniform;
  constexpr long count = 300;
  constexpr int tiles_x = 30, tiles_y = 20;
  std::vector<float> records;
  std::vector<std::uint32_t> rects, keys;
  std::uint64_t pairs = 0;
  for (long i = 0; i < count; ++i) {  // blobs and long, thin, slanted ones
    const float u = 16 * tiles_x * uniform(engine), v = 16 * tiles_y * uniform(engine);
    const float a = std::pow(10.0f, 4 * uniform(engine) - 0.5f), d = 0.3f + 30 * uniform(engine) * uniform(engine);
    const float k = 4 * uniform(engine) - 2, lo = -8 * uniform(engine), log2e = 1.4426950409f;
    for (const float f : {u, v, 0.0f, 1.0f, lo, k, -0.5f * log2e / a, -0.5f * log2e / d, 0.0f, 0.0f, 0.0f, 0.0f})
      records.push_back(f);
    const bool wide = i % 3 == 0;
    const std::uint32_t x0 = wide ? 0 : std::min(static_cast<unsigned>(u / 16), tiles_x - 2u),
                        y0 = wide ? 0 : std::min(static_cast<unsigned>(v / 16), tiles_y - 2u), w = wide ? tiles_x : 2,
                        h = wide ? tiles_y : 2;
    rects.push_back(x0 | (x0 + w) << 16), rects.push_back(y0 | (y0 + h) << 16);
    pairs += std::uint64_t{w} * h;
    keys.push_back(engine() % 50);
  }
  Projected p;
  p.rects = c.up({count, 2}, rects), p.keys = c.up({count}, keys), p.key_bits = 6,
  p.records = c.up({count, 12}, records);
  const Binned got = tile_bin(c.ctx, p, pairs, {0, 0, tiles_x, tiles_y}, {true, true});
  const auto ids = c.ctx.read<std::uint32_t>(got.ids), starts = c.ctx.read<std::uint32_t>(got.starts),
             offsets = c.ctx.read<std::uint32_t>(got.offsets), slots = c.ctx.read<std::uint32_t>(got.slots);
  const auto room = [&](std::size_t id, int tile) {  // margin of the largest exponent over the drawing threshold
    const float* r = &records[12 * id];
    const int left = 16 * (tile % tiles_x), top = 16 * (tile / tiles_x);
    double most = -1e30;
    // On a grid finer than a tile's pixels. In a column the grid point nearest to the slant has the largest exponent.
    for (int x = 0; x <= 60; ++x) {
      const double dx = r[0] - (left + 0.5 + x / 4.0), slant = r[1] - (top + 0.5) - r[5] * dx;
      const double t = slant - std::clamp(std::round(4 * slant), 0.0, 60.0) / 4;
      most = std::max(most, r[4] + r[6] * dx * dx + r[7] * t * t);
    }
    return most + std::log2(255.0);
  };
  bool right = starts.back() < pairs * 9 / 10;
  std::vector<std::uint32_t> next(offsets.begin(), offsets.end());
  for (int tile = 0; right && tile < tiles_x * tiles_y; ++tile) {
    const auto t = static_cast<std::size_t>(tile);
    for (std::uint32_t id = 0; right && id < count; ++id) {
      const std::uint32_t x = rects[2 * std::size_t{id}], y = rects[2 * std::size_t{id} + 1];
      const std::uint32_t tx = static_cast<unsigned>(tile % tiles_x), ty = static_cast<unsigned>(tile / tiles_x);
      if (tx < (x & 0xffff) || tx >= x >> 16 || ty < (y & 0xffff) || ty >= y >> 16) continue;
      const bool kept =
          std::find(ids.begin() + starts[t], ids.begin() + starts[t + 1], id) != ids.begin() + starts[t + 1];
      if (kept && id % 3 == 0) continue;
      const double by = room(id, tile);
      right = kept ? by > -1.0 : by < 0;
    }
    for (std::uint32_t i = starts[t]; right && i < starts[t + 1]; ++i) right = slots[i] == next[ids[i]]++;
  }
  c.that("tiles that are reached", right);
}

void tile_bin_all(Checks& c) {
  for (const long count : c.some({1L, 3L, 7L, 63L, 64L, 65L, 1500L})) tile_bin_of(c, count, 13, 9);
  tile_bin_of(c, 65, 1, 1);
  tile_bin_of(c, 9000, 40, 30);
  tile_bin_exact(c);
}

void rasterize_of(Checks& c, int width, int height, int per_tile, float opacity) {
  const Records r = make_records(width, height, per_tile, opacity, 3);
  const std::array<float, 3> background{0.25f, 0.5f, 1};
  const auto slots = slots_of(r);
  const long n = static_cast<long>(r.ids.size());
  Projected p;
  p.records = c.up({static_cast<long>(r.records.size() / 12), 12}, r.records);
  Binned b;
  b.ids = c.up({n}, r.ids), b.starts = c.up({static_cast<long>(r.starts.size())}, r.starts), b.slots = c.up({n}, slots);
  const Part whole{0, 0, (width + 15) / 16, (height + 15) / 16};
  const DevicePicture picture{c.gap({height, width, 3}), c.gap({height, width}), c.gap({height, width})};
  rasterize_forward(c.ctx, {p, b, whole, background, picture});
  const ref::Blended want = ref::blend(r.records, r.ids, r.starts, width, height, background);
  c.close("colour", picture.colour, want.colour, 1e-5);
  c.close("alpha", picture.alpha, want.alpha, 1e-5);
  c.close("depth", picture.depth, want.depth, 1e-5);
  const std::size_t pixels = draw_size(width, height);
  const auto by_colour = random_floats(3 * pixels, 5), by_alpha = random_floats(pixels, 6),
             by_depth = random_floats(pixels, 7);
  const PictureGradient by{c.up({height, width, 3}, by_colour), c.up({height, width}, by_alpha),
                           c.up({height, width}, by_depth)};
  c.keep();  // what is blended
  for (const auto& [pulls, kind, columns, what] :
       {std::tuple{Pulls::none, ref::RowKind::sums, 10, "backward"},
        {Pulls::held, ref::RowKind::pulls, 2, "pulls"},
        {Pulls::through, ref::RowKind::pulls_through_clamp, 2, "pulls through what is held"}}) {
    const IntersectionGradients got = rasterize_backward(c.ctx, {p, b, whole, background, picture, by, pulls});
    const std::size_t each = draw_size(columns);
    const auto sums = rows_in_order(c.ctx.read<float>(got.rows), c.ctx.read<std::uint8_t>(got.touched), slots, each);
    const auto wanted = [&, kind = kind] {
      return ref::blend_backward(r.records, r.ids, r.starts, width, height, background, by_colour, by_alpha, by_depth,
                                 kind);
    };
    c.close_by_column(what, sums, each, wanted, 2e-5);
  }
}

void rasterize_all(Checks& c) {
  for (const int size : c.some({1, 7, 15, 16, 17, 31, 53})) rasterize_of(c, size, 40, 30, 0.8f);
  for (const int count : c.some({1, 63, 64, 65, 257})) rasterize_of(c, 33, 20, count, 0.3f);
  rasterize_of(c, 48, 32, 400, 1.0f);
}

}  // namespace

std::vector<Case> drawing_cases() {
  return {{"project", project_all}, {"visible", visible_all}, {"tile_bin", tile_bin_all}, {"rasterize", rasterize_all}};
}

}  // namespace vsplat::selftest
