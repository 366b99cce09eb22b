#include "runtime/gemm.h"

#include <clblast.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "runtime/column_sum.h"
#include "runtime/compose_rows.h"
#include "runtime/fail.h"
#include "runtime/gemm_matrix.h"
#include "runtime/gemm_pack.h"
#include "runtime/gemm_pairs.h"
#include "runtime/log.h"
#include "runtime/option.h"
#include "runtime/rounding.h"

namespace vsplat {

const char* tile_defines(const DeviceInfo& device) { return device.native_float_width >= 4 ? "" : "-DTILE_LOOPS"; }

namespace {

constexpr long kTileRows = kPanelRows, kTileCols = kPanelColumns;
constexpr long kMostPanels = 8;  // of cl/dense/gemm_cpu.cl and cl/dense/gemm_rows_cpu.cl
// Scratch memory of the gpu flavour, which packs at most a quarter of it at a time.
constexpr long kScratchFloats = 2 << 20;

struct Sizes {
  long m, n, k, c0, c1, taps, src_rows, row0, out_row0;
};

[[noreturn]] void mismatch(const Gemm& g, const std::string& what, const Tensor& t, const std::string& expected) {
  fail(Status::internal, "{}: {} is {}, {} expected", g.name, what, t.describe(), expected);
}

Sizes check(const Gemm& g) {
  Sizes s{};
  if (!g.b || !g.b->data) fail(Status::internal, "{}: no B", g.name);
  if (!g.a.x0 || g.a.x0.rank() < 2) mismatch(g, "x0", g.a.x0, "[rows, C0]");
  s.n = g.b->n;
  s.c0 = g.a.x0.shape().back();
  s.src_rows = g.a.x0.rows();
  if (g.a.x1) {
    s.c1 = g.a.x1.rank() < 2 ? 0 : g.a.x1.shape().back();
    if (g.a.x1.rank() < 2 || g.a.x1.rows() != s.src_rows)
      mismatch(g, "x1", g.a.x1, fmt::format("[{}, C1]", s.src_rows));
  }
  s.taps = 1;
  if (g.a.map) {
    if (g.a.map.rank() != 2 || g.a.map.type() != Type::i32) mismatch(g, "map", g.a.map, "i32 [M, T]");
    s.taps = g.a.map.dim(1);
  }
  s.k = s.taps * (s.c0 + s.c1);
  if (s.k != g.b->k)
    fail(Status::internal, "{}: A's rows have {} values ({} x ({} + {})), B is {} x {}", g.name, s.k, s.taps, s.c0,
         s.c1, g.b->k, g.b->n);
  for (const Tensor& t : {g.a.scale, g.a.shift})
    if (t && t.count() != s.c0 + s.c1) mismatch(g, "scale or shift", t, fmt::format("[{}]", s.c0 + s.c1));
  if (static_cast<bool>(g.a.scale) != static_cast<bool>(g.a.shift))
    fail(Status::internal, "{}: scale and shift go together", g.name);
  if (g.bias && g.bias.count() != s.n) mismatch(g, "bias", g.bias, fmt::format("[{}]", s.n));

  const long all = g.a.map ? g.a.map.dim(0) : s.src_rows;
  s.row0 = g.row0;
  s.m = g.rows < 0 ? all - g.row0 : g.rows;
  s.out_row0 = g.out_row0 < 0 ? g.row0 : g.out_row0;
  if (s.row0 < 0 || s.m < 0 || s.row0 + s.m > all)
    fail(Status::internal, "{}: rows [{}, {}) of {}", g.name, s.row0, s.row0 + s.m, all);
  const long room = (s.out_row0 + s.m) * s.n;
  if (!g.out || g.out.shape().back() != s.n || g.out.count() < room)
    mismatch(g, "out", g.out, fmt::format("[{}, {}]", s.out_row0 + s.m, s.n));
  if (g.residual && (g.residual.shape().back() != s.n || g.residual.count() < room))
    mismatch(g, "residual", g.residual, fmt::format("[{}, {}]", s.out_row0 + s.m, s.n));
  for (const Tensor& t : {g.a.x0, g.a.x1, g.a.scale, g.a.shift, g.bias, g.residual, g.out})
    if (t && t.type() != Type::f32) fail(Status::internal, "{}: {} found, f32 expected", g.name, t.describe());
  return s;
}

Cost cost_of(const Gemm& g, const Sizes& s, long rows) {
  const double m = static_cast<double>(rows), n = static_cast<double>(s.n), k = static_cast<double>(s.k);
  return {2 * m * n * k, 4 * (m * k + n * k + m * n * (g.residual ? 2 : 1))};
}

Written written_rows(const Gemm& g, const Sizes& s) { return written(g.out, s.out_row0 * s.n, s.m * s.n); }

// Whether twelve rows of `width` numbers stay in a CPU's first-level cache while a tile moves along them: rows whose
// distance is a multiple of half a page compete for the same few cache sets.
bool rows_fit(long width) { return width % 512 != 0 || width == 0; }

// Whether to read A's rows in place: if nothing is composed, and there is a whole panel of rows.
bool wants_rows(const Gemm& g, const Sizes& s) {
  return !g.a.map && !g.a.scale && !g.a.silu && s.m >= kTileRows && s.k > 0 && rows_fit(s.c0) && rows_fit(s.c1);
}

void gemm_rows(Context& ctx, const Gemm& g, const Sizes& s, long block) {
  const char* defines = s.n <= 16 ? "-DCOLUMNS=16" : s.n <= 24 ? "-DCOLUMNS=24" : "";
  ctx.launch({"gemm_rows_cpu", "gemm_rows", defines, g.name},
             groups(div_up(s.n, kTileCols), 1, div_up(s.m, kTileRows * block)), cost_of(g, s, s.m), g.a.x0, s.c0,
             g.a.x1, s.c1, s.row0, g.b->data, block, s.m, s.n, g.bias, static_cast<int>(g.activation), g.residual,
             written_rows(g, s), s.out_row0);
}

// What multiplies a product in the cpu flavour.
struct CpuTile {
  KernelId kernel;
  long rows;   // of a panel of A
  long block;  // a row of packed A has a multiple of so many words
};

CpuTile cpu_tile(Context& ctx, const char* name, bool pairs, bool by_rows) {
  if (!pairs) return {{"gemm_cpu", "gemm_tile", tile_defines(ctx.device()), name}, kTileRows, 1};
  if (multiplies_by_amx(ctx)) return {{"gemm_amx_cpu", "gemm_amx_tile", pair_defines(ctx), name}, kAmxRows, kPairBlock};
  if (!by_rows) return {{"gemm_cpu", "gemm_tile", pair_defines(ctx), name}, kTileRows, 1};
  return {{"gemm_cpu", "gemm_tile", fmt::format("{} -DBLOCK={}", pair_defines(ctx), kPairBlock), name},
          kTileRows,
          kPairBlock};
}

// Packs rows [first, first + rows) of A to `out`.
void pack_a(Context& ctx, const Gemm& g, const Sizes& s, const CpuTile& tile, long first, long rows,
            const Tensor& out) {
  const bool pairs = g.b->pairs;
  const long panels = div_up(rows, tile.rows), row = round_up(pairs ? div_up(s.k, 2L) : s.k, tile.block);
  const KernelId by_pairs{"gemm_pack_pairs_cpu", "gemm_pack_a_pairs",
                          fmt::format("{} -DPANEL_ROWS={}", pair_defines(ctx), tile.rows)};
  const double read = 4.0 * static_cast<double>(rows) * static_cast<double>(s.k);
  ctx.launch(pairs ? by_pairs : KernelId{"gemm_cpu", "gemm_pack_a", tile_defines(ctx.device())},
             pairs ? groups(panels, 1) : groups(s.taps, 1, panels), {0, pairs ? 1.5 * read : 2 * read}, g.a.x0, s.c0,
             g.a.x1, s.c1, g.a.scale, g.a.shift, g.a.silu ? 1 : 0, g.a.map, s.taps, s.src_rows, s.row0 + first, rows,
             written(out, panels * row * tile.rows));
}

// The part of A that is packed at a time fits into a CPU's last-level cache and bounds scratch memory; the part of it
// that a work-item multiplies with each panel of B fits into the second-level cache.
void gemm_cpu(Context& ctx, const Gemm& g, const Sizes& s) {
  check_tile_terms(ctx.device(), g.name, s.k);
  const TunedValues tuned = ctx.tuned({TunedOp::gemm, {s.m, s.n, s.k, s.taps}});
  const bool loops = *tile_defines(ctx.device()) != '\0', pairs = g.b->pairs;
  const long k = pairs ? div_up(s.k, 2L) : s.k;  // words of a row of B
  const CpuTile tile = cpu_tile(ctx, g.name, pairs, true);
  const long row = round_up(k, tile.block), panel = std::max(1L, row * tile.rows);
  // One panel for each work-item if the tile is computed in loops: llvmpipe ends all loops of a work-item after 65535
  // iterations in all.
  const long block = loops ? 1 : std::clamp(tuned.at("block") / panel, 1L, kMostPanels);
  if (!loops && !pairs && wants_rows(g, s)) return gemm_rows(ctx, g, s, block);
  const long panels = div_up(s.m, tile.rows);
  const long step = std::clamp(tuned.at("scratch") / panel, 1L, std::max(1L, panels));
  const Tensor scratch = ctx.tensor({step, row, tile.rows}, pairs ? Type::u32 : Type::f32, "packed rows");
  for (long p = 0; p < panels; p += step) {
    const long first = p * tile.rows, rows = std::min(s.m - first, step * tile.rows);
    pack_a(ctx, g, s, tile, first, rows, scratch);
    ctx.launch(tile.kernel, groups(div_up(s.n, kTileCols), 1, div_up(div_up(rows, tile.rows), block)),
               cost_of(g, s, rows), scratch, g.b->data, block, rows, s.n, k, g.bias, static_cast<int>(g.activation),
               g.residual, written(g.out, (s.out_row0 + first) * s.n, rows * s.n), s.out_row0 + first);
  }
}

// Terms of a part of a sum: a multiple of the kernel's step.
long terms_of_part(long k, long parts) { return round_up(div_up(k, parts), 16L); }

// The number of parts, if tuning asks for a split: parts must not be too short, and their sums must fit into scratch
// memory.
long parts_of(const TunedValues& tuned, const Sizes& s) {
  constexpr long few = 64;
  const long room = 4 * kScratchFloats / std::max(1L, s.m * s.n);
  const long most = std::clamp(std::min(tuned.at("split"), room), 1L, std::max(1L, s.k / few));
  return s.k > 0 ? div_up(s.k, terms_of_part(s.k, most)) : 1;
}

// Splits the sums, since few output tiles would leave a GPU idle: parts are computed side by side, then added up in
// order.
void gemm_split(Context& ctx, const Gemm& g, const Sizes& s, const GpuTile& shape, long count) {
  const Tensor parts = ctx.tensor({count, s.m, s.n}, Type::f32, "partial sums");
  ctx.launch({"gemm_gpu", "gemm_split_gpu", shape.defines, g.name},
             groups(div_up(s.n, shape.side), shape.group, div_up(s.m, shape.side), count), cost_of(g, s, s.m), g.a.x0,
             s.c0, g.a.x1, s.c1, g.a.scale, g.a.shift, g.a.silu ? 1 : 0, g.a.map, s.taps, s.src_rows, s.row0, g.b->data,
             s.m, s.n, terms_of_part(s.k, count), written(parts));
  ctx.launch({"gemm_gpu", "gemm_split_sum", ""}, items(s.m * s.n),
             {static_cast<double>(parts.count()), static_cast<double>(parts.bytes())}, parts, count, s.m, s.n, g.bias,
             static_cast<int>(g.activation), g.residual, written_rows(g, s), s.out_row0);
}

void gemm_gpu(Context& ctx, const Gemm& g, const Sizes& s) {
  const TunedValues tuned = ctx.tuned({TunedOp::gemm, {s.m, s.n, s.k, s.taps}});
  const long count = parts_of(tuned, s);
  const char* kernel = count > 1 ? "gemm_split_gpu" : "gemm_tile_gpu";
  const GpuTile shape = gpu_tile(ctx, {"gemm_gpu", kernel, {}}, tuned, s.m, s.n);
  if (count > 1) return gemm_split(ctx, g, s, shape, count);
  const long tile = shape.side;
  ctx.launch({"gemm_gpu", "gemm_tile_gpu", shape.defines, g.name},
             groups(div_up(s.n, tile), shape.group, div_up(s.m, tile)), cost_of(g, s, s.m), g.a.x0, s.c0, g.a.x1, s.c1,
             g.a.scale, g.a.shift, g.a.silu ? 1 : 0, g.a.map, s.taps, s.src_rows, s.row0, g.b->data, s.m, s.n, g.bias,
             static_cast<int>(g.activation), g.residual, written_rows(g, s), s.out_row0);
}

void gemm_mixed(Context& ctx, const Gemm& g, const Sizes& s) {
  MatrixProducts p;
  p.a = g.a, p.src_rows = s.src_rows, p.row0 = s.row0;
  p.b = g.b->data, p.m = s.m, p.n = s.n;
  p.bias = g.bias, p.activation = g.activation, p.residual = g.residual;
  p.out = g.out, p.out_row0 = s.out_row0, p.name = g.name, p.cost = cost_of(g, s, s.m);
  gemm_matrix(ctx, p);
}

// A map that reads each row many times would compose it as often; storing the composed rows then pays off.
bool wants_composed(const Gemm& g, const Sizes& s) {
  return g.a.map && (g.a.scale || g.a.silu) && s.m * s.taps > 2 * s.src_rows;
}

Tensor composed(Context& ctx, const Gemm& g, const Sizes& s) {
  const Tensor y = ctx.tensor({s.src_rows, s.c0 + s.c1}, Type::f32, "composed rows");
  RowSource rows = g.a;
  rows.map = {};
  compose_rows(ctx, rows, y);
  return y;
}

// Whether CLBlast multiplies: only on request, and only if A needs no composing. (On an H100 with NVIDIA's driver 580
// it takes 60 to 450 ms for a product, in which it allocates buffers; our kernels take 0.4 to 3 ms.)
bool wants_clblast(const Context& ctx, const Gemm& g) {
  if (g.a.x1 || g.a.scale || g.a.silu || g.a.map) return false;
  return ctx.gemm_choice() == GemmChoice::clblast;
}

bool gemm_clblast(Context& ctx, const Gemm& g, const Sizes& s) {
  const auto u = [](long v) { return static_cast<std::size_t>(v); };
  const Tensor& b = g.b->plain ? g.b->plain : g.b->data;
  const bool epilogue = g.bias || g.residual || g.activation != Activation::none;
  // The product goes to `out`, unless that still holds the residual.
  const bool aside = g.residual && g.residual.block() == g.out.block();
  const Tensor product = aside ? ctx.tensor({s.m, s.n}, Type::f32, "product") : g.out;
  const long product_row0 = aside ? 0 : s.out_row0;

  auto queue = static_cast<cl_command_queue>(ctx.raw_queue());
  using clblast::Layout;
  using clblast::Transpose;
  std::size_t bytes = 0;
  auto status = clblast::GemmTempBufferSize<float>(Layout::kRowMajor, Transpose::kNo, Transpose::kNo, u(s.m), u(s.n),
                                                   u(s.k), u(s.row0 * s.k), u(s.k), 0, u(s.n), u(product_row0 * s.n),
                                                   u(s.n), &queue, bytes);
  if (status == clblast::StatusCode::kSuccess) {
    const Tensor scratch =
        bytes > 0 ? ctx.tensor({static_cast<long>((bytes + 3) / 4)}, Type::f32, "CLBlast's copies") : Tensor();
    if (ctx.planning()) return true;
    const auto memory = [&](const Tensor& t) { return static_cast<cl_mem>(ctx.raw_buffer(t)); };
    cl_event event = nullptr;
    status = clblast::Gemm(Layout::kRowMajor, Transpose::kNo, Transpose::kNo, u(s.m), u(s.n), u(s.k), 1.0f,
                           memory(g.a.x0), u(s.row0 * s.k), u(s.k), memory(b), 0, u(s.n), 0.0f, memory(product),
                           u(product_row0 * s.n), u(s.n), &queue, &event, memory(scratch));
    if (status == clblast::StatusCode::kSuccess)
      ctx.record_foreign(g.name, cost_of(g, s, s.m), event, written(product, product_row0 * s.n, s.m * s.n));
  }
  if (status != clblast::StatusCode::kSuccess) {
    const std::string what = fmt::format("{}: CLBlast refuses {} x {} x {} on {} with status {}", g.name, s.m, s.n, s.k,
                                         ctx.device().name, static_cast<int>(status));
    if (ctx.gemm_choice() == GemmChoice::clblast)
      fail(Status::device, "{}; leave the choice to the program or choose its own", what);
    verbose("{}", what);
    return false;
  }
  if (epilogue)
    ctx.launch({"gemm_gpu", "gemm_epilogue", ""}, items(s.m * s.n),
               {0, 4.0 * static_cast<double>(s.m * s.n) * (g.residual ? 3 : 2)}, product, product_row0, s.m, s.n,
               g.bias, static_cast<int>(g.activation), g.residual, written_rows(g, s), s.out_row0);
  return true;
}

// Splits a long product by rows, as Context::launch() splits our own launches.
bool in_parts_by_clblast(Context& ctx, const Gemm& g, const Sizes& s) {
  constexpr long step = 256;  // rows
  const double row = cost_of(g, s, 1).flops;
  const double most = std::min(std::max(1.0, ctx.device().most_flops / row / step) * step, static_cast<double>(s.m));
  const long rows = static_cast<long>(most) == s.m ? s.m : static_cast<long>(most) / step * step;
  for (long done = 0; done < s.m; done += rows) {
    Gemm part = g;
    part.row0 = s.row0 + done, part.rows = std::min(rows, s.m - done), part.out_row0 = s.out_row0 + done;
    if (gemm_clblast(ctx, part, check(part))) continue;
    if (done > 0) fail(Status::device, "{}: CLBlast refuses rows from {} on, after those before", g.name, done);
    return false;
  }
  return true;
}

constexpr long kSumRows = 1024;  // terms of a sum that is not split (the cpu flavour splits at 256)

struct TransposedSizes {
  long rows, m, n;
};

Cost cost_of(const TransposedSizes& s, long rows, long sums) {
  const double m = static_cast<double>(s.m), n = static_cast<double>(s.n), k = static_cast<double>(rows);
  return {2 * m * n * k, 4 * (m * k + n * k + m * n * static_cast<double>(sums))};
}

// Processes the rows of one sum at a time and adds to out: both operands' panels stay in a cache.
void transposed_cpu(Context& ctx, const TransposedGemm& g, const TransposedSizes& s) {
  const TunedValues tuned = ctx.tuned({TunedOp::gemm_transposed, {s.rows, s.m, s.n}});
  const long most = std::min(s.rows, tuned.at("terms"));
  const long block = *tile_defines(ctx.device()) ? 1 : tuned.at("block");  // see gemm_cpu()
  check_tile_terms(ctx.device(), g.name, most);
  const bool pairs = wants_pairs(ctx, s.rows, std::min(s.m, s.n));
  const Type type = pairs ? Type::u32 : Type::f32;
  const auto words = [&](long terms) { return pairs ? div_up(terms, 2L) : terms; };
  const CpuTile tile = cpu_tile(ctx, g.name, pairs, false);
  const long panels = div_up(s.m, tile.rows);
  const Tensor a = ctx.tensor({panels, round_up(words(most), tile.block), tile.rows}, type, "packed rows");
  const Tensor b = ctx.tensor({div_up(s.n, kTileCols), words(most), kTileCols}, type, "packed rows");
  for (long row = 0; row < s.rows; row += most) {
    const long terms = std::min(most, s.rows - row);
    if (tile.rows == kAmxRows)
      pack_columns_for_amx(ctx, g.a, row, terms, s.m, a);
    else
      pack_panels(ctx, {g.a, 0, row, terms, s.m, s.m, 1}, kTileRows, pairs, a);
    pack_panels(ctx, {g.b, 0, row, terms, s.n, s.n, 1}, kTileCols, pairs, b);
    ctx.launch(tile.kernel, groups(div_up(s.n, kTileCols), 1, div_up(panels, block)),
               cost_of(s, terms, g.add || row > 0 ? 2 : 1), a, b, block, s.m, s.n, words(terms), Tensor(),
               static_cast<int>(Activation::none), g.add || row > 0 ? g.out : Tensor(), written(g.out), 0);
  }
}

// Computes as many sums side by side as fit into scratch memory: few output tiles would leave a GPU idle.
void transposed_gpu(Context& ctx, const TransposedGemm& g, const TransposedSizes& s) {
  const GpuTile shape = gpu_tile(ctx, {"gemm_gpu", "gemm_transposed_gpu", {}},
                                 ctx.tuned({TunedOp::gemm_transposed, {s.rows, s.m, s.n}}), s.m, s.n);
  const long all = div_up(s.rows, kSumRows), room = 4 * kScratchFloats / std::max(s.m * s.n, s.m * kSumRows);
  const long most = std::clamp(room, 1L, all);
  const Tensor a = ctx.tensor({std::min(s.rows, most * kSumRows), s.m}, Type::f32, "packed rows");
  const Tensor parts = most > 1 ? ctx.tensor({most, s.m * s.n}, Type::f32, "partial sums") : Tensor();
  for (long done = 0; done < all; done += most) {
    const long sums = std::min(most, all - done), row = done * kSumRows;
    const long rows = std::min(s.rows - row, sums * kSumRows);
    const bool add = g.add || done > 0;
    pack_plain(ctx, {g.a, 0, row, s.m, rows, 1, s.m}, kSumRows, a);
    ctx.launch({"gemm_gpu", "gemm_transposed_gpu", shape.defines, g.name},
               groups(div_up(s.n, shape.side), shape.group, div_up(s.m, shape.side), sums),
               cost_of(s, rows, sums + (add && !parts ? 1 : 0)), a, g.b, row, rows, kSumRows, s.m, s.n,
               add && !parts ? g.out : Tensor(), parts ? written(parts, sums * s.m * s.n) : written(g.out));
    if (parts) column_sum(ctx, {parts.first(sums), g.out, add});
  }
}

}  // namespace

GpuTile gpu_tile(Context& ctx, const KernelId& kernel, const TunedValues& tuned, long m, long n) {
  struct Variant {
    long side, group, local;  // local memory in bytes
    const char* defines;
  };
  constexpr std::array<Variant, 4> variants = {{{128, 256, 16640, "-DRM=8 -DRN=8"},
                                                {64, 256, 8448, ""},
                                                {64, 64, 4224, "-DSIDE=8 -DRM=8 -DRN=8"},
                                                {32, 64, 2176, "-DSIDE=8"}}};
  // Larger tiles load less for each product, but there must be enough of them to keep every unit busy.
  const long enough = 2L * ctx.device().compute_units, asked = tuned.at("tile"), unroll = tuned.at("unroll");
  for (const Variant& v : variants) {
    const bool by_rule =
        v.side * v.side == 16 * v.group || (2 * n > v.side && div_up(m, v.side) * div_up(n, v.side) >= enough);
    if (asked > 0 ? v.side > asked : !by_rule) continue;
    if (v.side == 128 && ctx.switched_off().large_tiles) continue;
    KernelId id = kernel;
    id.defines = v.defines;
    if (unroll > 0) id.defines += fmt::format("{}-DUNROLL={}", id.defines.empty() ? "" : " ", unroll);
    if (ctx.takes(id, static_cast<std::size_t>(v.group), static_cast<std::size_t>(v.local)))
      return {v.side, v.group, id.defines};
  }
  fail(Status::device, "{}: {} takes none of its variants, not even in groups of 64", kernel.name, ctx.device().name);
}

long square_side(const Context& ctx) { return ctx.device().max_work_group >= 256 ? 16 : 8; }

void check_tile_terms(const DeviceInfo& device, const char* name, long terms) {
  constexpr long most = 65535 / (kTileRows + 1) - 64;  // an iteration a row and term, less the tile's rest
  if (*tile_defines(device) && terms > most)
    fail(Status::device,
         "{}: sums of {} terms; {} has no vectors, and its cpu kernels are right for at most {} (choose "
         "gpu as {}, or another device)",
         name, terms, device.name, most, Option::kernels);
}

void gemm(Context& ctx, const Gemm& g) {
  const Sizes s = check(g);
  if (s.m == 0 || s.n == 0) return;
  if (wants_composed(g, s)) {
    Gemm plain = g;
    plain.a = RowSource();
    plain.a.x0 = composed(ctx, g, s);
    plain.a.map = g.a.map;
    return gemm(ctx, plain);
  }
  if (g.exact && g.b->pairs) fail(Status::internal, "{}: an exact product with a rounded matrix", g.name);
  if (ctx.flavour() == Flavour::gpu && !g.exact && wants_matrix(ctx, s.m, s.n, s.k)) return gemm_mixed(ctx, g, s);
  if (s.k > 0 && wants_clblast(ctx, g) && in_parts_by_clblast(ctx, g, s)) return;
  if (ctx.flavour() == Flavour::cpu)
    gemm_cpu(ctx, g, s);
  else
    gemm_gpu(ctx, g, s);
}

void transposed_gemm(Context& ctx, const TransposedGemm& g) {
  for (const Tensor& t : {g.a, g.b, g.out})
    if (!t || t.rank() < 2 || t.type() != Type::f32)
      fail(Status::internal, "{}: {} found, an f32 matrix expected", g.name, t.describe());
  const TransposedSizes s{g.a.rows(), g.a.shape().back(), g.b.shape().back()};
  if (g.b.rows() != s.rows || g.out.shape() != Shape{s.m, s.n})
    fail(Status::internal, "{}: {} and {} give [{}, {}] where their rows are as many; out is {}", g.name,
         g.a.describe(), g.b.describe(), s.m, s.n, g.out.describe());
  if (s.m == 0 || s.n == 0) return;
  if (s.rows == 0) {
    if (!g.add) ctx.fill_zero(g.out);
  } else if (ctx.flavour() == Flavour::cpu) {
    transposed_cpu(ctx, g, s);
  } else {
    transposed_gpu(ctx, g, s);
  }
}

}  // namespace vsplat
