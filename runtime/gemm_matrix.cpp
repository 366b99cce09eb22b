#include "runtime/gemm_matrix.h"

#include <array>
#include <cstdlib>

#include "runtime/fail.h"
#include "runtime/rounding.h"
#include "runtime/system/environment.h"

namespace vsplat {
namespace {

// A tile size of cl/dense/gemm_matrix.clh.
struct MatrixTile {
  long rows, columns, group, local;  // local memory in bytes
  const char* defines;
};

struct UnitKernel {
  MatrixUnit unit;
  const char* name;                 // name of the file and of its kernel
  bool tf32;                        // has tf32 operands, too
  bool fours;                       // has a variant for rows of multiples of four
  std::array<MatrixTile, 3> tiles;  // largest first; unused entries have group 0
};

constexpr std::array<UnitKernel, 5> kKernels = {
    {{MatrixUnit::emulated,
      "gemm_matrix_gpu",
      true,
      true,
      {{{128, 128, 256, 20480, "-DWIDE"}, {64, 64, 128, 10240, ""}, {64, 32, 64, 7680, "-DNARROW"}}}},
     {MatrixUnit::ptx,
      "gemm_matrix_ptx_gpu",
      true,
      true,
      {{{128, 128, 256, 20480, "-DWIDE"}, {64, 64, 128, 10240, ""}, {}}}},
     {MatrixUnit::dpas, "gemm_matrix_dpas_gpu", false, false, {{{64, 64, 64, 10240, ""}, {}, {}}}},
     {MatrixUnit::wmma, "gemm_matrix_wmma_gpu", false, false, {{{64, 64, 128, 10240, ""}, {}, {}}}},
     {MatrixUnit::mfma, "gemm_matrix_mfma_gpu", false, false, {{{64, 64, 256, 10240, ""}, {}, {}}}}}};

// The chosen kernel, with the defines of its tile.
struct Chosen {
  KernelId kernel;
  MatrixTile tile;
};

Chosen choose(Context& ctx, const MatrixProducts& p) {
  if (is_of_processor(ctx.matrix_unit())) fail(Status::internal, "{}: pairs have no fragments", p.name);
  const UnitKernel& of = kKernels.at(static_cast<std::size_t>(ctx.matrix_unit()));
  if (p.operands == Operands::tf32 && !of.tf32)
    fail(Status::internal, "{}: {} multiplies no tf32", p.name, name_of(of.unit));
  const long enough = 2L * ctx.device().compute_units;
  const long c0 = p.a.x0.shape().back(), c1 = p.a.x1 ? p.a.x1.shape().back() : 0;
  const bool fours = of.fours && c0 % 4 == 0 && c1 % 4 == 0 && p.n % 4 == 0;
  for (const MatrixTile& tile : of.tiles) {
    if (tile.group == 0) continue;
    const bool wide = tile.rows == 128;
    if (wide && (ctx.switched_off().large_tiles || 2 * p.n <= tile.columns ||
                 p.products * div_up(p.m, tile.rows) * div_up(p.n, tile.columns) < enough))
      continue;
    KernelId id{of.name, of.name, tile.defines, p.name};
    const auto define = [&](const char* one) { id.defines += (id.defines.empty() ? "" : " ") + std::string(one); };
    if (p.operands == Operands::tf32) define("-DMATRIX_TF32");
    if (fours) define("-DFOURS");
    if (ctx.takes(id, static_cast<std::size_t>(tile.group), static_cast<std::size_t>(tile.local))) return {id, tile};
  }
  fail(Status::device, "{}: {} takes none of the tiles of its {} matrix units", p.name, ctx.device().name,
       name_of(of.unit));
}

}  // namespace

void gemm_matrix(Context& ctx, const MatrixProducts& p) {
  const long c0 = p.a.x0.shape().back(), c1 = p.a.x1 ? p.a.x1.shape().back() : 0;
  const long taps = p.line > 0 ? 3 : p.a.map ? p.a.map.dim(1) : 1;
  const long k = taps * (c0 + c1), all = p.products * p.m * p.n;
  if (p.b.count() < p.products * k * p.n)
    fail(Status::internal, "{}: B is {}, {} x {} x {} expected", p.name, p.b.describe(), p.products, k, p.n);
  if (p.products > 1 && (p.residual || p.out_row0 > 0 || p.row0 > 0 || p.a.x1))
    fail(Status::internal, "{}: {} products with what only one may have", p.name, p.products);
  if (p.a.map && p.line > 0) fail(Status::internal, "{}: rows of lines and of a map", p.name);
  if (all == 0) return;
  const auto [kernel, tile] = choose(ctx, p);
  ctx.launch(kernel, groups(div_up(p.n, tile.columns), tile.group, div_up(p.m, tile.rows), p.products), p.cost, p.a.x0,
             c0, p.a.x1, c1, p.a.scale, p.a.shift, p.a.silu ? 1 : 0, p.a.map, taps, p.line, p.src_rows, p.row0, p.b,
             p.m, p.n, p.bias, static_cast<int>(p.activation), p.residual, written(p.out, p.out_row0 * p.n, all),
             p.out_row0);
}

bool wants_matrix(const Context& ctx, long m, long n, long k) {
  if (ctx.precision() != Precision::mixed) return false;
  const std::string asked = environment("VSPLAT_MATRIX_LEAST");
  const long least = asked.empty() ? 32 : std::strtol(asked.c_str(), nullptr, 10);
  return m >= least && n >= least && k >= least;
}

}  // namespace vsplat
