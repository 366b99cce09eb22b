// Blending: Gaussians in every tile, each seen by that tile alone.
#include <array>
#include <cmath>

#include "model/diagnose/tune/sample.h"
#include "model/diagnose/tune/tune_cases.h"
#include "model/ops/render/rasterize.h"

namespace vsplat::tuning {
namespace {

constexpr long kMostTiles = 1024, kMostInTile = 256, kNumbers = 12;
constexpr int kPixels = 300;

class RasterizeCase : public TuneCase {
 public:
  RasterizeCase(Context& ctx, long tiles, long intersections)
      : along_(std::clamp(std::lround(std::sqrt(static_cast<double>(tiles))), 1L, std::lround(std::sqrt(kMostTiles)))),
        in_tile_(std::clamp(intersections / std::max(1L, tiles), 1L, kMostInTile)),
        edge_(along_ * kTile - 5) {
    const long all = along_ * along_, n = all * in_tile_;
    const std::vector<float> random = numbers(n * kNumbers, 1);
    records_.resize(random.size());
    for (long i = 0; i < n; ++i)
      write_record(random.data() + i * kNumbers, i / in_tile_, records_.data() + i * kNumbers);
    std::vector<std::uint32_t> ids, starts;
    for (long i = 0; i < n; ++i) ids.push_back(static_cast<std::uint32_t>(i));
    for (long i = 0; i <= all; ++i) starts.push_back(static_cast<std::uint32_t>(i * in_tile_));
    const int tiles_along = static_cast<int>(along_);
    a_.projected.records = ctx.upload({n, kNumbers}, records_);
    a_.binned.ids = ctx.upload({n}, ids, Type::u32);
    a_.binned.starts = ctx.upload({all + 1}, starts, Type::u32);
    a_.part = {0, 0, tiles_along, tiles_along};
    a_.background = {0.25f, 0.5f, 0.75f};
    a_.picture = make_picture(ctx, static_cast<int>(edge_), static_cast<int>(edge_));
    flops = 39.0 * static_cast<double>(n) * kTile * kTile;
  }

  std::function<void()> ready(Context& ctx) override {
    return [this, &ctx] { rasterize_forward(ctx, a_); };
  }

  std::vector<Tensor> outputs() const override { return {a_.picture.colour, a_.picture.alpha, a_.picture.depth}; }

  double error(Context& ctx) override {
    const auto colour = ctx.read<float>(a_.picture.colour), alpha = ctx.read<float>(a_.picture.alpha),
               depth = ctx.read<float>(a_.picture.depth);
    WorstError of_light, of_depth;
    for (const long i : sampled(edge_ * edge_, kPixels)) {
      const Blended want = blended(i);
      if (want.by_a_hair) continue;
      const auto at = static_cast<std::size_t>(i);
      for (std::size_t c = 0; c < 3; ++c) of_light.add(static_cast<double>(colour[3 * at + c]), want.colour[c]);
      of_light.add(static_cast<double>(alpha[at]), want.alpha);
      of_depth.add(static_cast<double>(depth[at]), want.depth);
    }
    return std::max(of_light.of_largest(), of_depth.of_largest());
  }

 private:
  // u, v, extent in rows, depth; log2 of opacity, k, qx, qy; colour: as in cl/render/project.cl.
  void write_record(const float* random, long tile, float* out) const {
    const auto between = [&](int i, float low, float high) { return low + (high - low) * (random[i] + 1) / 2; };
    const float wide = between(3, 1, 9), high = between(4, 1, 9);
    const long column = tile % along_, row = tile / along_;
    out[0] = static_cast<float>(column * kTile) + between(0, -4, 20);
    out[1] = static_cast<float>(row * kTile) + between(1, -4, 20);
    out[2] = 64;
    out[3] = between(2, 1, 3);
    out[4] = std::log2(between(5, 0.01f, 0.95f));
    out[5] = between(6, -1, 1);
    out[6] = -0.72f / (wide * wide), out[7] = -0.72f / (high * high);
    for (int c = 8; c < 11; ++c) out[c] = between(c, 0, 1);
    out[11] = 0;
  }

  struct Blended {
    std::array<double, 3> colour{};
    double alpha = 0, depth = 0;
    bool by_a_hair = false;  // so close to a threshold that a float may decide differently
  };

  Blended blended(long pixel) const {
    constexpr double least = 1.0 / 255, left_least = 1e-4, hair = 1e-3;
    const long x = pixel % edge_, y = pixel / edge_, tile = y / kTile * along_ + x / kTile;
    Blended out;
    double left = 1;
    for (long i = tile * in_tile_; i < (tile + 1) * in_tile_; ++i) {
      const float* r = records_.data() + i * kNumbers;
      const double dx = static_cast<double>(r[0]) - static_cast<double>(x) - 0.5,
                   dy = static_cast<double>(r[1]) - static_cast<double>(y) - 0.5;
      const double t = dy - static_cast<double>(r[5]) * dx;
      const double power =
          static_cast<double>(r[4]) + static_cast<double>(r[6]) * dx * dx + static_cast<double>(r[7]) * t * t;
      const double a = std::min(0.99, std::exp2(power));
      out.by_a_hair = out.by_a_hair || std::abs(a / least - 1) < hair;
      if (a < least) continue;
      const double after = left * (1 - a), w = left * a;
      out.by_a_hair = out.by_a_hair || std::abs(after / left_least - 1) < hair;
      if (after < left_least) break;
      for (std::size_t c = 0; c < 3; ++c) out.colour[c] += w * static_cast<double>(r[8 + c]);
      out.alpha += w, out.depth += w * static_cast<double>(r[3]);
      left = after;
    }
    for (std::size_t c = 0; c < 3; ++c) out.colour[c] += (1 - out.alpha) * static_cast<double>(a_.background[c]);
    return out;
  }

  long along_, in_tile_, edge_;
  std::vector<float> records_;
  RasterizeForward a_;
};

}  // namespace

std::unique_ptr<TuneCase> rasterize_case(Context& ctx, const TunedShape& shape) {
  if (shape.op != TunedOp::rasterize_forward) return nullptr;
  return std::make_unique<RasterizeCase>(ctx, shape.sizes[0], shape.sizes[1]);
}

}  // namespace vsplat::tuning
