#include "model/render/gaussian_chunks.h"

#include <algorithm>

#include "model/ops/render/project_surfels.h"
#include "model/render/reserve.h"

namespace vsplat {
namespace {

double bytes_of(const Gaussians& g) {
  return 4.0 * (8.0 + scales_of(g.kind) + 3.0 * static_cast<double>(g.drawn_sh_count()));
}

long whole_units(double gaussians) {
  return std::max(static_cast<long>(gaussians / static_cast<double>(kChunkUnit)), 1L) * kChunkUnit;
}

}  // namespace

GaussianChunks::GaussianChunks(const DeviceGaussians& g)
    : count(g.count()),
      sh_degree(g.sh_degree()),
      chunk((g.count() / kChunkUnit + 1) * kChunkUnit),
      get([g](Context&, long) { return g; }),
      kind(g.kind()) {}

GaussianChunks::GaussianChunks(long all, int degree, long each, std::function<DeviceGaussians(Context&, long)> chunk_at,
                               GaussianKind what)
    : count(all), sh_degree(degree), chunk(each), get(std::move(chunk_at)), kind(what) {}

GaussianChunks place_on_device(Context& ctx, const Gaussians& g, double pixels) {
  const ArenaLimits& limits = ctx.memory().limits();
  const long k = static_cast<long>(g.count);
  const bool surfels = g.kind == GaussianKind::surfel;
  // Memory beside the scene: a picture, and for each Gaussian its projection and its sort pairs, assuming a few tiles.
  const double drawing = 12 + 16 + 4.0 * static_cast<double>(surfels ? kSurfelRecord : kRecord) + 16 + 4 * 8;
  const double limit = static_cast<double>(limits.total), n = static_cast<double>(k);
  const double left = limit - static_cast<double>(ctx.memory().live()) - n * (bytes_of(g) + drawing) - 20 * pixels;
  const double largest = 12.0 * static_cast<double>(g.drawn_sh_count());  // bytes of a Gaussian in the largest array
  if (left > 0) {
    const long chunk =
        std::min(whole_units(static_cast<double>(limits.max_alloc) / largest), whole_units(n) + kChunkUnit);
    std::vector<DeviceGaussians> parts;
    GaussianChunks out(k, g.drawn_degree(), chunk, nullptr, g.kind);
    const auto place = [&](Context& c) {
      parts.clear();
      for (long i = 0; i < out.chunks(); ++i) parts.push_back(upload(c, g, i * chunk, out.size_of(i)));
    };
    if (reserve_for(ctx, place)) {
      place(ctx);
      out.get = [parts](Context&, long i) { return parts.at(static_cast<std::size_t>(i)); };
      return out;
    }
  }
  const double room = std::min(limit / 8 / bytes_of(g), static_cast<double>(limits.max_alloc) / largest);
  GaussianChunks out(k, g.drawn_degree(), whole_units(room), nullptr, g.kind);
  out.get = [&g, size = out](Context& c, long i) { return upload(c, g, i * size.chunk, size.size_of(i)); };
  return out;
}

}  // namespace vsplat
