#include "model/ops/render/rasterize.h"

#include <algorithm>

#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr long kColumns = 10;  // of a row of IntersectionGradients
constexpr long kBatch = 64;    // Gaussians of a tile that a work-item of the cpu flavour processes together
// Operations for a pixel and a Gaussian that it sees; a multiply-add counts as two. Both directions: alpha (27: place
// 2, form 8, exponential 14, the rest 3), transmittance and weight (3). Forward: four sums and the weight's (9).
// Backward: the gradient by the weight (9), the part behind the Gaussian (1), the slope (5), and ten sums (19) or two
// pulls (10). Pairs with an alpha below 1/255 are computed, too, but do not count.
constexpr double kForwardFlops = 39, kBackwardFlops = 64, kPullFlops = 55;
constexpr long kBackwardPixels = 4;  // least pixels of an item in the gpu flavour, so that fewer items share a sum

// Whether tiles are blended in blocks, as in the cpu flavour; the device must support vectors for that.
bool in_blocks(const Context& ctx) { return ctx.flavour() == Flavour::cpu && ctx.device().native_float_width >= 4; }

// Bytes of local memory: a record for each item of a group; backward also its index, and sums for each 16 items.
std::size_t local_bytes(const TileKernel& k, long group) {
  const long each = 4 * k.record + (k.columns ? 4 : 0),
             sums = k.columns ? 4 * k.columns * (group + 2 * (group / 16)) : 0;
  return static_cast<std::size_t>(group * each + sums + 64);
}

}  // namespace

double most_blended(double n, double flops) { return n * static_cast<double>(kTile * kTile) * flops; }

TileLaunch tile_launch(const TileKernel& kernel, Context& ctx, long tiles) {
  if (in_blocks(ctx))
    return {
        {kernel.file, kernel.cpu,
         "-DBATCH=" + std::to_string(kernel.batch > 0 ? kernel.batch : kBatch) + kernel.defines, nullptr, kernel.flops},
        groups(tiles, 1)};
  const long least = kernel.columns ? kBackwardPixels : 1;
  for (long pixels = std::max(kernel.pixels, least); pixels <= kTile; pixels *= 2) {
    const long group = kTile * kTile / pixels;
    const KernelId id{kernel.file, kernel.gpu, "-DPIXELS=" + std::to_string(pixels) + kernel.defines, nullptr,
                      kernel.flops};
    if (ctx.takes(id, static_cast<std::size_t>(group), local_bytes(kernel, group))) return {id, groups(tiles, group)};
  }
  fail(Status::device, "{}: {} allows work-groups of {} items with {} bytes of local memory, {} with {} are needed",
       kernel.file, ctx.device().name, ctx.device().max_work_group, ctx.device().local_memory, kTile,
       local_bytes(kernel, kTile));
}

void bind_blended(Dims& d, const Projected& projected, const Binned& binned, const Part& part,
                  const DevicePicture& picture, const char* record, const char* operation) {
  d.set("tiles + 1", part.tiles() + 1);
  d.bind("records", projected.records, {"V", record})
      .bind("ids", binned.ids, {"N"}, Type::u32)
      .bind("starts", binned.starts, {"tiles + 1"}, Type::u32)
      .bind("colour", picture.colour, {"H", "W", "3"})
      .bind("alpha", picture.alpha, {"H", "W"})
      .bind("depth", picture.depth, {"H", "W"});
  d.bind_optional("normal", picture.normal, {"H", "W", "3"});
  d.bind_optional("median", picture.median, {"H", "W"});
  d.bind_optional("distortion", picture.distortion, {"H", "W"});
  d.bind_optional("moments", picture.moments, {"H", "W", "2"});
  if (part.x0 < 0 || part.y0 < 0 || part.x1 > tiles_along(d["W"]) || part.y1 > tiles_along(d["H"]))
    fail(Status::internal, "{}: a part that ends at tile {}, {} of {} x {} pixels", operation, part.x1, part.y1, d["W"],
         d["H"]);
}

void bind_gradient(Dims& d, const Binned& binned, const PictureGradient& dpicture) {
  d.bind("slots", binned.slots, {"N"}, Type::u32);
  d.bind_optional("dpicture.colour", dpicture.colour, {"H", "W", "3"});
  d.bind_optional("dpicture.alpha", dpicture.alpha, {"H", "W"});
  d.bind_optional("dpicture.depth", dpicture.depth, {"H", "W"});
  d.bind_optional("dpicture.normal", dpicture.normal, {"H", "W", "3"});
  d.bind_optional("dpicture.distortion", dpicture.distortion, {"H", "W"});
}

IntersectionGradients make_rows(Context& ctx, long n, long columns) {
  const IntersectionGradients out{ctx.tensor({n, columns}, Type::f32, "rasterize_backward.rows"),
                                  ctx.tensor({n}, Type::u8, "rasterize_backward.touched")};
  ctx.fill_zero(out.touched);
  return out;
}

DevicePicture make_picture(Context& ctx, int width, int height, const SurfelMaps& maps) {
  const auto map = [&](bool wanted, const Shape& shape, const char* what) {
    return wanted ? ctx.tensor(shape, Type::f32, what) : Tensor();
  };
  return {ctx.tensor({height, width, 3}, Type::f32, "picture.colour"),
          ctx.tensor({height, width}, Type::f32, "picture.alpha"),
          ctx.tensor({height, width}, Type::f32, "picture.depth"),
          map(maps.normal, {height, width, 3}, "picture.normal"),
          map(maps.median, {height, width}, "picture.median"),
          map(maps.distortion, {height, width}, "picture.distortion"),
          map(maps.distortion, {height, width, 2}, "picture.moments")};
}

void rasterize_forward(Context& ctx, const RasterizeForward& a) {
  const Part& part = a.part;
  const long tiles = part.tiles();
  Dims d;
  bind_blended(d, a.projected, a.binned, part, a.picture, "12", "rasterize");
  const double n = static_cast<double>(d["N"]), pixels = static_cast<double>(tiles * kTile * kTile);
  // How much is blended is known only afterwards, so only the bytes that must move count.
  const Cost cost{0, n * 52.0 + pixels * 20.0, 0, most_blended(n, kForwardFlops)};
  const bool whole = part.tiles_x() == tiles_along(d["W"]) && tiles == tiles_along(d["W"]) * tiles_along(d["H"]);
  const auto drawn = [&](const Tensor& t) { return whole ? written(t) : written_somewhere(t); };
  TileKernel kernel{"rasterize", "rasterize_forward_cpu", "rasterize_forward_gpu", "", kRecord, 0, kForwardFlops};
  const TunedValues tuned = ctx.tuned({TunedOp::rasterize_forward, {tiles, d["N"]}});
  (ctx.flavour() == Flavour::cpu ? kernel.batch : kernel.pixels) =
      tuned.at(ctx.flavour() == Flavour::cpu ? "batch" : "pixels");
  const TileLaunch l = tile_launch(kernel, ctx, tiles);
  ctx.launch(l.id, l.range, cost, a.projected.records, a.binned.ids, a.binned.starts, drawn(a.picture.colour),
             drawn(a.picture.alpha), drawn(a.picture.depth), d["W"], d["H"], part.x0, part.y0, part.tiles_x(), tiles,
             a.background[0], a.background[1], a.background[2]);
}

IntersectionGradients rasterize_backward(Context& ctx, const RasterizeBackward& a) {
  const Part& part = a.part;
  const PictureGradient& dp = a.dpicture;
  const long tiles = part.tiles();
  Dims d;
  bind_blended(d, a.projected, a.binned, part, a.picture, "12", "rasterize_backward");
  bind_gradient(d, a.binned, dp);
  const bool pulls = a.pulls != Pulls::none;
  const std::string flavour = !pulls                      ? a.weigh ? " -DWEIGH" : ""
                              : a.pulls == Pulls::through ? " -DPULL -DTHROUGH_CLAMP"
                                                          : " -DPULL";
  const IntersectionGradients out = make_rows(ctx, d["N"], pulls ? 2 : kColumns);
  const double n = static_cast<double>(d["N"]), pixels = static_cast<double>(tiles * kTile * kTile);
  // As in drawing, only the bytes that must move count.
  const Cost cost{0, n * (56.0 + 4.0 * kColumns + 1.0) + pixels * 40.0, 0,
                  most_blended(n, pulls ? kPullFlops : kBackwardFlops)};
  const TileLaunch l = tile_launch({"rasterize_backward", "rasterize_backward_cpu", "rasterize_backward_gpu", flavour,
                                    kRecord, kColumns, pulls ? kPullFlops : kBackwardFlops},
                                   ctx, tiles);
  ctx.launch(l.id, l.range, cost, a.projected.records, a.binned.ids, a.binned.starts, a.binned.slots, a.picture.colour,
             a.picture.alpha, a.picture.depth, dp.colour, dp.alpha, dp.depth, written_somewhere(out.rows),
             written(out.touched), d["W"], d["H"], part.x0, part.y0, part.tiles_x(), tiles, a.background[0],
             a.background[1], a.background[2]);
  return out;
}

}  // namespace vsplat
