#include "model/ops/dense/conv3d.h"

#include <algorithm>
#include <bit>

#include "model/ops/dense/gather.h"
#include "runtime/bfloat16.h"
#include "runtime/column_sum.h"
#include "runtime/compose_rows.h"
#include "runtime/fail.h"
#include "runtime/gemm_matrix.h"
#include "runtime/gemm_pairs.h"
#include "runtime/rounding.h"
#include "runtime/shape_check.h"

namespace vsplat {

namespace {

constexpr long kTileRows = 12, kTileCols = 32, kPackRows = 14;  // of cl/dense/tile_cpu.clh and cl/dense/conv3d_cpu.cl
// Limit of the floats of a weight gradient's partial sums and of their operands, which bounds scratch memory.
constexpr long kScratchFloats = 4 << 20;
constexpr long kTileSide = 4, kCoefficients = 36, kMostTiles = 4;  // of cl/dense/conv3d_winograd.cl

// Element k of the rows that a kernel multiplies with: which tap, which input channel.
struct TapChannel {
  long tap, channel;
};

// w [Cout][Cin][taps], rearranged to the order of k that `order` gives.
template <class Order>
ConvWeights pack(Context& ctx, const float* w, const float* bias, long cout, long cin, long taps, const Order& order,
                 const std::string& what, bool exact = false) {
  const long k = taps * cin;
  std::vector<float> rows;
  if (!ctx.planning()) {
    rows.resize(static_cast<std::size_t>(cout * k));
    for (long n = 0; n < cout; ++n)
      for (long i = 0; i < k; ++i) {
        const TapChannel at = order(i);
        rows[static_cast<std::size_t>(n * k + i)] = w[(n * cin + at.channel) * taps + at.tap];
      }
  }
  ConvWeights out;
  out.cin = cin, out.cout = cout;
  out.w = pack_matrix(ctx, rows.data(), k, cout, 1, k, what, exact);
  if (bias) out.bias = ctx.upload({cout}, bias, Type::f32, what + " bias");
  return out;
}

// The shape of u in cl/dense/conv3d_winograd.cl or cl/dense/conv3d_winograd_gpu.cl.
Shape winograd_shape(const Context& ctx, long cout, long cin) {
  if (ctx.flavour() == Flavour::gpu) return {kCoefficients, 3, cin, cout};
  return {div_up(cout, kTileCols), kCoefficients, wants_pairs(ctx, cin, cout) ? div_up(cin, 2L) : cin, 3, kTileCols};
}

std::string winograd_defines(const Context& ctx, bool pairs) { return pairs ? pair_defines(ctx) : ""; }

// G g G^T over x and y for all of w [Cout][Cin][3][3][3], as the cpu kernels read it.
ConvWeights pack_winograd(Context& ctx, const float* w, const float* bias, long cout, long cin,
                          const std::string& what) {
  constexpr double p = 0.75, q = 1.5, pp = p * p, qq = q * q;
  constexpr double at_p = 1 / (2 * pp * (pp - qq)), at_q = 1 / (2 * qq * (qq - pp));
  constexpr double g[6][3] = {{1 / (pp * qq), 0, 0},       {at_p, at_p * p, at_p * pp},  {at_p, -at_p * p, at_p * pp},
                              {at_q, at_q * q, at_q * qq}, {at_q, -at_q * q, at_q * qq}, {0, 0, 1}};
  ConvWeights out;
  const bool pairs = wants_pairs(ctx, cin, cout);
  out.cin = cin, out.cout = cout, out.winograd = true;
  out.w.k = kCoefficients * 3 * cin, out.w.n = cout, out.w.pairs = pairs;
  out.w.data = ctx.tensor(winograd_shape(ctx, cout, cin), pairs ? Type::u32 : Type::f32, what);
  if (bias) out.bias = ctx.upload({cout}, bias, Type::f32, what + " bias");
  if (ctx.planning()) return out;
  // Words: floats, or pairs of operands, the second ones in the upper halves.
  std::vector<std::uint32_t> u(static_cast<std::size_t>(out.w.data.count()), 0u);
  const long share = pairs ? 2 : 1;  // channels of a word
  for (long c = 0; c < cin; ++c)     // output channels lie side by side in u
    for (long n = 0; n < cout; ++n) {
      const long c0 = c / 16 * 16 / share, width = div_up(std::min(16L, cin - c / 16 * 16), share);  // of its block
      for (long dz = 0; dz < 3; ++dz) {
        const float* from = w + (n * cin + c) * 27 + dz;
        double half_way[6][3];
        for (int i = 0; i < 6; ++i)
          for (int dy = 0; dy < 3; ++dy)
            half_way[i][dy] = g[i][0] * from[dy * 3] + g[i][1] * from[9 + dy * 3] + g[i][2] * from[18 + dy * 3];
        for (int i = 0; i < 6; ++i)
          for (int j = 0; j < 6; ++j) {
            const double value = g[j][0] * half_way[i][0] + g[j][1] * half_way[i][1] + g[j][2] * half_way[i][2];
            const long k = i * 6 + j;
            const long row = (n / kTileCols * kCoefficients + k) * div_up(cin, share) * 3 + c0 * 3;
            const long at = (row + dz * width + c / share - c0) * kTileCols + n % kTileCols;
            const auto rounded = static_cast<float>(value);
            u[static_cast<std::size_t>(at)] |= pairs ? static_cast<std::uint32_t>(to_bfloat16(rounded)) << 16 * (c % 2)
                                                     : std::bit_cast<std::uint32_t>(rounded);
          }
      }
    }
  ctx.write(out.w.data, u.data());
  return out;
}

ConvMethod choose(const Context& ctx, ConvMethod method, long cout, long cin) {
  if (method != ConvMethod::auto_) return method;
  const bool gpu = ctx.flavour() == Flavour::gpu;
  if (ctx.switched_off().winograd || (!gpu && ctx.device().native_float_width < 4)) return ConvMethod::direct;
  const TunedValues tuned = ctx.tuned({TunedOp::conv3d_method, {cin, cout}});
  if (tuned.of && tuned.at("method") > 0) return static_cast<ConvMethod>(tuned.at("method"));
  // The cpu flavour keeps transformed data in registers; the gpu flavour passes it through memory.
  return std::min(cin, cout) >= (gpu ? 64 : 32) ? ConvMethod::winograd : ConvMethod::direct;
}

// On the device. mirrored: see weight_of() in cl/dense/conv3d.clh.
ConvWeights pack_on_device(Context& ctx, const Tensor& w, bool mirrored, const std::string& what, ConvMethod method) {
  if (w.rank() != 5 || w.count() != w.dim(0) * w.dim(1) * 27 || w.type() != Type::f32)
    fail(Status::internal, "{}: weights are {}, [Cout, Cin, 3, 3, 3] expected", what, w.describe());
  const long n = w.dim(mirrored ? 1 : 0), c = w.dim(mirrored ? 0 : 1), panels = div_up(n, kTileCols);
  const bool cpu = ctx.flavour() == Flavour::cpu;
  ConvWeights out;
  out.cin = c, out.cout = n, out.winograd = choose(ctx, method, n, c) == ConvMethod::winograd;
  out.w.k = (out.winograd ? 3 * kCoefficients : 27) * c, out.w.n = n;
  out.w.pairs = out.winograd && wants_pairs(ctx, c, n);
  out.w.data = ctx.tensor(out.winograd ? winograd_shape(ctx, n, c)
                          : cpu        ? Shape{panels, out.w.k, kTileCols}
                                       : Shape{out.w.k, n},
                          out.w.pairs ? Type::u32 : Type::f32, what);
  const Cost cost{0, static_cast<double>(w.bytes()) + static_cast<double>(out.w.data.bytes())};
  if (out.winograd && !cpu)
    ctx.launch({"conv3d_winograd_gpu", "winograd_pack_weights_gpu", ""}, items(3 * c * n), cost, w, mirrored ? 1 : 0, c,
               n, written(out.w.data));
  else if (out.winograd)
    ctx.launch({"conv3d_winograd", "winograd_pack_weights", winograd_defines(ctx, out.w.pairs)},
               groups(panels, 1, out.w.pairs ? div_up(c, 2L) : c), cost, w, mirrored ? 1 : 0, c, n,
               written(out.w.data));
  else
    ctx.launch({cpu ? "conv3d_cpu" : "conv3d_gpu", "conv3d_pack_weights", cpu ? tile_defines(ctx.device()) : ""},
               items(out.w.data.count()), cost, w, mirrored ? 1 : 0, c, n, written(out.w.data));
  return out;
}

struct Shape3d {
  long x, y, z, c0, c1, n;
  long c() const { return c0 + c1; }
};

TunedShape tuned_shape(TunedOp op, const Shape3d& s) { return {op, {s.x * s.y * s.z, s.c(), s.n}}; }

Shape3d check(const Conv3dForward& c) {
  if (!c.weights || !c.weights->w.data) fail(Status::internal, "{}: no weights", c.name);
  if (!c.in.x0 || c.in.x0.rank() < 2 || c.in.map) fail(Status::internal, "{}: the input is a volume", c.name);
  if (c.x < 0 || c.y < 0 || c.z < 0) fail(Status::internal, "{}: a volume of {}x{}x{}", c.name, c.x, c.y, c.z);
  const Shape3d s{c.x, c.y, c.z, c.in.x0.shape().back(), c.in.x1 ? c.in.x1.shape().back() : 0, c.weights->cout};
  const long voxels = s.x * s.y * s.z;
  const auto expect = [&](const char* what, const Tensor& t, long count) {
    if (t && (t.count() != count || t.type() != Type::f32))
      fail(Status::internal, "{}: {} is {}, {} numbers expected for {}x{}x{} and {}+{} -> {} channels", c.name, what,
           t.describe(), count, s.x, s.y, s.z, s.c0, s.c1, s.n);
  };
  expect("x0", c.in.x0, voxels * s.c0);
  expect("x1", c.in.x1, voxels * s.c1);
  expect("scale", c.in.scale, s.c());
  expect("shift", c.in.shift, s.c());
  expect("residual", c.residual, voxels * s.n);
  if (!c.out) fail(Status::internal, "{}: no out", c.name);
  expect("out", c.out, voxels * s.n);
  expect("bias", c.weights->bias, s.n);
  if (c.weights->cin != s.c() || c.weights->w.k != (c.weights->winograd ? 3 * kCoefficients : 27) * s.c())
    fail(Status::internal, "{}: the input has {}+{} channels, the weights {} (and {} taps)", c.name, s.c0, s.c1,
         c.weights->cin, c.weights->cin ? c.weights->w.k / c.weights->cin : 0);
  if (static_cast<bool>(c.in.scale) != static_cast<bool>(c.in.shift))
    fail(Status::internal, "{}: scale and shift go together", c.name);
  return s;
}

Cost cost_of(const Conv3dForward& c, const Shape3d& s, long planes) {
  const double voxels = static_cast<double>(planes * s.y * s.z), ch = static_cast<double>(s.c()),
               n = static_cast<double>(s.n);
  return {conv3d_flops(*c.weights, planes, s.y, s.z),
          4 * (voxels * ch + 27 * ch * n + voxels * n * (c.residual ? 2 : 1))};
}

void forward_cpu(Context& ctx, const Conv3dForward& c, const Shape3d& s) {
  check_tile_terms(ctx.device(), c.name, 27 * s.c());
  const long zt = div_up(s.z, kTileRows);
  const long plane = s.y * zt * s.c() * kPackRows;
  // Out planes [p, p + step) need planes [p - 1, p + step + 1) in the ring. Few launches, yet packed planes stay in a
  // CPU's last-level cache.
  const long scratch = ctx.tuned(tuned_shape(TunedOp::conv3d, s)).at("scratch");
  const long step = std::clamp(scratch / std::max(1L, plane) - 2, 1L, s.x);
  const long ring_planes = std::min(step + 2, s.x);
  const Tensor ring = ctx.tensor({ring_planes, s.y, zt, s.c(), kPackRows}, Type::f32, "packed planes");
  long packed = 0;
  for (long p = 0; p < s.x; p += step) {
    const long planes = std::min(step, s.x - p);
    const long until = std::min(s.x, p + planes + 1);
    const double bytes = 4.0 * static_cast<double>((until - packed) * (s.y * s.z * s.c() + plane));
    ctx.launch({"conv3d_cpu", "conv3d_forward_pack", tile_defines(ctx.device())}, groups(zt, 1, s.y, until - packed),
               {0, bytes}, c.in.x0, s.c0, c.in.x1, s.c1, c.in.scale, c.in.shift, c.in.silu ? 1 : 0, s.y, s.z,
               ring_planes, packed, written(ring, std::min(until, ring_planes) * plane));
    packed = until;
    ctx.launch({"conv3d_cpu", "conv3d_forward_cpu", tile_defines(ctx.device()), c.name},
               groups(zt * s.y, 1, planes, div_up(s.n, kTileCols)), cost_of(c, s, planes), ring, c.weights->w.data,
               s.c(), s.n, s.x, s.y, s.z, ring_planes, p, c.weights->bias, c.residual,
               written(c.out, p * s.y * s.z * s.n, planes * s.y * s.z * s.n));
  }
}

// The operations of Winograd's method in the transformed domain, of so many tiles of lines along z.
double multiplied(long tiles, const Shape3d& s) {
  return 6 * static_cast<double>(kCoefficients * tiles * s.z) * static_cast<double>(s.c()) * static_cast<double>(s.n);
}

// Those of the direct sum, over the whole volume.
double direct_flops(const Shape3d& s) {
  return 54 * static_cast<double>(s.x * s.y * s.z) * static_cast<double>(s.c()) * static_cast<double>(s.n);
}

void forward_winograd(Context& ctx, const Conv3dForward& c, const Shape3d& s) {
  const long zt = div_up(s.z, kTileRows), tiles = div_up(s.x, kTileSide) * div_up(s.y, kTileSide);
  const bool pairs = c.weights->w.pairs;
  const bool amx = pairs && multiplies_by_amx(ctx) && s.c() % 16 == 0;
  const std::string defines = winograd_defines(ctx, pairs) + (amx ? " -DMATRIX_AMX" : "");
  const long blocks = div_up(s.c(), 16L), words = pairs ? 8 : 16;  // of 16 channels
  const long per_tile = zt * kCoefficients * blocks * kPackRows * words;
  const long scratch = ctx.tuned(tuned_shape(TunedOp::conv3d_winograd, s)).at("scratch");
  const long step = std::clamp(scratch / std::max(1L, per_tile), 1L, tiles);
  const Tensor v = ctx.tensor({step, zt, kCoefficients, blocks, kPackRows, words}, pairs ? Type::u32 : Type::f32,
                              "transformed tiles");
  const Cost whole = cost_of(c, s, s.x);
  for (long t = 0; t < tiles; t += step) {
    const long count = std::min(step, tiles - t);
    const double share = static_cast<double>(count) / static_cast<double>(tiles);
    ctx.launch({"conv3d_winograd", "winograd_forward_pack", defines}, groups(zt, 1, count),
               {0, 4.0 * static_cast<double>(count * per_tile)}, c.in.x0, s.c0, c.in.x1, s.c1, c.in.scale, c.in.shift,
               c.in.silu ? 1 : 0, s.x, s.y, s.z, t,
               s.c() % 16 == 0 ? written(v, count * per_tile) : written_somewhere(v));
    // As many tiles a work-item as leave several work-items for each core.
    const long panels = div_up(s.n, kTileCols), cores = ctx.device().compute_units;
    const long each = std::clamp(zt * count * panels / (4 * cores), 1L, kMostTiles);
    ctx.launch({"conv3d_winograd", "winograd_forward_tile", defines, c.name},
               groups(div_up(zt * count, each), 1, panels),
               {direct_flops(s) * share, whole.bytes * share, multiplied(count, s)}, v, c.weights->w.data, s.c(), s.n,
               s.x, s.y, s.z, t, zt * count, each, c.weights->bias, c.residual,
               t + count == tiles ? written(c.out) : written_somewhere(c.out));
  }
}

void forward_winograd_gpu(Context& ctx, const Conv3dForward& c, const Shape3d& s) {
  const long tiles = div_up(s.x, kTileSide) * div_up(s.y, kTileSide);
  const long in = kCoefficients * (s.z + 2) * s.c(), out = kCoefficients * s.z * s.n;  // numbers of a tile
  const TunedValues tuned = ctx.tuned(tuned_shape(TunedOp::conv3d_winograd, s));
  const long step = std::clamp(tuned.at("scratch") / (in + out), 1L, tiles);
  const Tensor v = ctx.tensor({kCoefficients, step, s.z + 2, s.c()}, Type::f32, "transformed tiles");
  const Tensor m = ctx.tensor({kCoefficients, step, s.z, s.n}, Type::f32, "their products");
  const Cost whole = cost_of(c, s, s.x);
  for (long t = 0; t < tiles; t += step) {
    const long count = std::min(step, tiles - t);
    const double share = static_cast<double>(count) / static_cast<double>(tiles), to = whole.bytes * share / 2;
    const double packed = 4.0 * static_cast<double>(count * in), products = 4.0 * static_cast<double>(count * out);
    ctx.launch({"conv3d_winograd_gpu", "winograd_forward_pack_gpu", ""}, items(count * (s.z + 2) * s.c()),
               {0, packed + to}, c.in.x0, s.c0, c.in.x1, s.c1, c.in.scale, c.in.shift, c.in.silu ? 1 : 0, s.x, s.y, s.z,
               t, count, written(v, count * in));
    const Cost cost{direct_flops(s) * share, packed + products, multiplied(count, s)};
    if (wants_matrix(ctx, step * s.z, s.n, 3 * s.c())) {
      MatrixProducts p;
      p.a.x0 = v, p.line = s.z, p.src_rows = count * (s.z + 2);
      p.b = c.weights->w.data, p.products = kCoefficients, p.m = count * s.z, p.n = s.n;
      p.out = m, p.name = c.name, p.cost = cost;
      gemm_matrix(ctx, p);
    } else {
      const GpuTile tile = gpu_tile(ctx, {"conv3d_winograd_gpu", "winograd_forward_tile_gpu", {}}, tuned,
                                    kCoefficients * step * s.z, s.n);
      ctx.launch({"conv3d_winograd_gpu", "winograd_forward_tile_gpu", tile.defines, c.name},
                 groups(div_up(s.n, tile.side), tile.group, div_up(count * s.z, tile.side), kCoefficients), cost, v,
                 c.weights->w.data, count, s.z, s.c(), s.n, written(m, count * out));
    }
    ctx.launch({"conv3d_winograd_gpu", "winograd_forward_unpack_gpu", ""}, items(count * s.z * s.n), {0, products + to},
               m, s.x, s.y, s.z, s.n, t, count, c.weights->bias, c.residual,
               t + count == tiles ? written(c.out) : written_somewhere(c.out));
  }
}

void forward_gpu(Context& ctx, const Conv3dForward& c, const Shape3d& s) {
  const GpuTile tile = gpu_tile(ctx, {"conv3d_gpu", "conv3d_forward_gpu", {}},
                                ctx.tuned(tuned_shape(TunedOp::conv3d, s)), s.x * s.y * s.z, s.n);
  ctx.launch({"conv3d_gpu", "conv3d_forward_gpu", tile.defines, c.name},
             groups(div_up(s.n, tile.side), tile.group, div_up(s.x * s.y * s.z, tile.side)), cost_of(c, s, s.x),
             c.in.x0, s.c0, c.in.x1, s.c1, c.in.scale, c.in.shift, c.in.silu ? 1 : 0, s.x, s.y, s.z, c.weights->w.data,
             s.n, c.weights->bias, c.residual, written(c.out));
}

void backward_weights_direct(Context& ctx, const Conv3dBackwardWeights& g, const Shape3d& s) {
  const long voxels = s.x * s.y * s.z, k = 27 * s.c();
  // Chunks of whole lines along z: short sums, unless their partial results would take too much memory.
  const long most = std::max(1L, kScratchFloats / (k * s.n));
  const long lines = std::max(div_up(1024L, s.z), div_up(s.x * s.y, most)), chunks = div_up(s.x * s.y, lines);
  const Tensor partial = ctx.tensor({chunks, k, s.n}, Type::f32, "partial weight gradients");
  const Cost cost{54 * static_cast<double>(voxels) * static_cast<double>(s.c()) * static_cast<double>(s.n),
                  4 * static_cast<double>(voxels * (s.c() + s.n)) + static_cast<double>(partial.bytes())};
  if (ctx.flavour() == Flavour::cpu) {
    check_tile_terms(ctx.device(), g.name, lines * (s.z + 1));
    const std::string defines = tile_defines(ctx.device());
    const auto panels = [&](const RowSource& of, long c0, long c1, long width) {
      const Tensor to = ctx.tensor({div_up(c0 + c1, width), voxels, width}, Type::f32, "columns");
      ctx.launch({"conv3d_cpu", "conv3d_backward_panels", defines}, items(voxels, 1),
                 {0, 8 * static_cast<double>(voxels * (c0 + c1))}, of.x0, c0, of.x1, c1, of.scale, of.shift,
                 of.silu ? 1 : 0, voxels, width, written(to));
      return to;
    };
    RowSource dy;
    dy.x0 = g.dy;
    const Tensor in = panels(g.in, s.c0, s.c1, kTileRows), out = panels(dy, s.n, 0, kTileCols);
    ctx.launch({"conv3d_cpu", "conv3d_backward_weights_cpu", defines, g.name},
               groups(27 * div_up(s.c(), kTileRows), 1, div_up(s.n, kTileCols), chunks), cost, in, out, s.c(), s.n, s.x,
               s.y, s.z, lines, written(partial));
  } else {
    const GpuTile tile = gpu_tile(ctx, {"conv3d_gpu", "conv3d_backward_weights_gpu", {}},
                                  ctx.tuned(tuned_shape(TunedOp::conv3d_weights, s)), k, s.n);
    ctx.launch({"conv3d_gpu", "conv3d_backward_weights_gpu", tile.defines, g.name},
               groups(div_up(s.n, tile.side), tile.group, div_up(k, tile.side), chunks), cost, g.in.x0, s.c0, g.in.x1,
               s.c1, g.in.scale, g.in.shift, g.in.silu ? 1 : 0, s.x, s.y, s.z, g.dy, s.n, lines * s.z,
               written(partial));
  }
  ctx.launch({"conv3d_backward", "conv3d_backward_weights_sum", ""}, items(k * s.n),
             {static_cast<double>(partial.count()), static_cast<double>(partial.bytes())}, partial, written(g.dw),
             chunks, s.c(), s.n);
}

void backward_weights_winograd(Context& ctx, const Conv3dBackwardWeights& g, const Shape3d& s) {
  if (ctx.flavour() != Flavour::cpu) fail(Status::usage, "{}: Winograd's method is for the cpu kernels", g.name);
  Tensor x = g.in.x0;
  if (g.in.x1 || g.in.scale || g.in.silu) {
    x = ctx.tensor({s.x * s.y * s.z, s.c()}, Type::f32, "composed rows");
    compose_rows(ctx, g.in, x);
  }
  const long tiles = div_up(s.x, kTileSide) * div_up(s.y, kTileSide), np = div_up(s.n, kTileCols) * kTileCols;
  const bool pairs = wants_pairs(ctx, s.c(), s.n);
  const long share = pairs ? 2 : 1;  // tiles of a word
  const std::string defines = winograd_defines(ctx, pairs);
  // As many tiles at a time as make sums of some 1024 terms.
  const long most = std::max(1L, 2 * kScratchFloats / (kCoefficients * s.z * (s.c() + np)));
  const long step = std::min(tiles, round_up(std::min(most, div_up(1024L, s.z)), share));
  const Type type = pairs ? Type::u32 : Type::f32;
  const Tensor v =
      ctx.tensor({kCoefficients * div_up(step, share) * s.z * s.c() + kTileRows}, type, "transformed tiles");
  const Tensor e = ctx.tensor({kCoefficients, div_up(step, share), s.z, np}, type, "transformed gradients");
  const Tensor m = ctx.tensor({kCoefficients, 3, s.c(), s.n}, Type::f32, "transformed weight gradients");
  const double cn = static_cast<double>(s.c()) * static_cast<double>(s.n);
  for (long t = 0; t < tiles; t += step) {
    const long count = std::min(step, tiles - t), words = div_up(count, share);
    const double rows = static_cast<double>(kCoefficients * words * s.z);
    ctx.launch({"conv3d_winograd_backward", "winograd_backward_in", defines}, groups(s.z, 1, words),
               {0, 4 * rows * static_cast<double>(s.c())}, x, s.c(), s.x, s.y, s.z, t, count,
               written(v, kCoefficients * words * s.z * s.c()));
    ctx.launch({"conv3d_winograd_backward", "winograd_backward_out", defines}, groups(s.z, 1, words),
               {0, 4 * rows * static_cast<double>(np)}, g.dy, s.n, s.x, s.y, s.z, t, count,
               written(e, kCoefficients * words * s.z * np));
    ctx.launch({"conv3d_winograd_backward", "winograd_backward_tile", defines, g.name},
               groups(div_up(s.c(), kTileRows), 1, np / kTileCols, kCoefficients),
               {direct_flops(s) * static_cast<double>(count) / static_cast<double>(tiles),
                4 * (rows * static_cast<double>(s.c() + np) + 3 * kCoefficients * cn), multiplied(count, s)},
               v, e, s.c(), s.n, s.z, words, t > 0 ? 1 : 0, written(m));
  }
  ctx.launch({"conv3d_winograd_backward", "winograd_backward_sum", defines}, groups(div_up(s.n, 16L), 1, s.c()),
             {0, 4.0 * static_cast<double>(m.count() + 2 * g.dw.count())}, m, s.c(), s.n, written(g.dw));
}

}  // namespace

ConvWeights pack_conv3d(Context& ctx, const float* w, const float* bias, long cout, long cin, const std::string& what,
                        ConvMethod method) {
  if (ctx.flavour() == Flavour::gpu) {
    const Tensor as_stored = ctx.upload({cout, cin, 3, 3, 3}, w, Type::f32, what + ", unpacked");
    ConvWeights out = pack_on_device(ctx, as_stored, false, what, method);
    if (bias) out.bias = ctx.upload({cout}, bias, Type::f32, what + " bias");
    return out;
  }
  if (choose(ctx, method, cout, cin) == ConvMethod::winograd) return pack_winograd(ctx, w, bias, cout, cin, what);
  // (dx, dy), channel, dz, so that a tile's three taps along z share what is in cache.
  const auto order = [&](long k) { return TapChannel{k / (3 * cin) * 3 + k % 3, k / 3 % cin}; };
  return pack(ctx, w, bias, cout, cin, 27, order, what, true);
}

ConvWeights pack_conv3d(Context& ctx, const Tensor& w, const Tensor& bias, const std::string& what, ConvMethod method) {
  ConvWeights out = pack_on_device(ctx, w, false, what, method);
  out.bias = bias;
  return out;
}

ConvWeights pack_conv3d_down(Context& ctx, const float* w, const float* bias, long cout, long cin,
                             const std::string& what) {
  return pack(
      ctx, w, bias, cout, cin, 8,
      [&](long k) {
        return TapChannel{k / cin, k % cin};
      },
      what);
}

double conv3d_flops(const ConvWeights& weights, long x, long y, long z) {
  const double products = static_cast<double>(weights.cin) * static_cast<double>(weights.cout);
  const double tiles = static_cast<double>(div_up(x, kTileSide) * div_up(y, kTileSide));
  return 2 * products * static_cast<double>(z) *
         (weights.winograd ? 3.0 * kCoefficients * tiles : 27.0 * static_cast<double>(x * y));
}

void conv3d_forward(Context& ctx, const Conv3dForward& c) {
  const Shape3d s = check(c);
  if (s.x * s.y * s.z * s.n == 0) return;
  if (c.weights->winograd)
    (ctx.flavour() == Flavour::cpu ? forward_winograd : forward_winograd_gpu)(ctx, c, s);
  else if (ctx.flavour() == Flavour::cpu)
    forward_cpu(ctx, c, s);
  else
    forward_gpu(ctx, c, s);
}

void conv3d_backward_weights(Context& ctx, const Conv3dBackwardWeights& g) {
  if (!g.dy || g.dy.rank() != 2 || !g.dw || g.dw.rank() != 5)
    fail(Status::internal, "{}: dy [voxels, Cout] and dw [Cout, Cin, 3, 3, 3] are needed", g.name);
  // The shapes are those of a convolution from `in` to dy.
  ConvWeights weights;
  weights.w.data = g.dw;
  weights.cin = g.dw.dim(1), weights.cout = g.dw.dim(0);
  weights.w.k = weights.cout == 0 ? 0 : g.dw.count() / weights.cout;
  weights.bias = g.dbias;
  Conv3dForward c;
  c.in = g.in, c.x = g.x, c.y = g.y, c.z = g.z, c.weights = &weights, c.out = g.dy, c.name = g.name;
  const Shape3d s = check(c);
  const long voxels = s.x * s.y * s.z, k = 27 * s.c();
  if (voxels * k * s.n == 0) return;
  if (g.dbias) column_sum(ctx, {g.dy, g.dbias, true});

  const bool direct = ctx.flavour() == Flavour::gpu && g.method == ConvMethod::auto_;
  if (!direct && choose(ctx, g.method, s.n, s.c()) == ConvMethod::winograd)
    backward_weights_winograd(ctx, g, s);
  else
    backward_weights_direct(ctx, g, s);
}

void conv3d_backward_inputs(Context& ctx, const Conv3dBackwardInputs& g) {
  // The path from voxel i through a tap to voxel j leads back through the opposite tap.
  const ConvWeights mirrored = pack_on_device(ctx, g.w, true, g.name, g.method);
  Conv3dForward c;
  c.in.x0 = g.dy;
  c.x = g.x, c.y = g.y, c.z = g.z;
  c.weights = &mirrored;
  c.out = g.dx;
  c.name = g.name;
  conv3d_forward(ctx, c);
}

}  // namespace vsplat
