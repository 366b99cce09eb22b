#include "runtime/gemm_pack.h"

#include "runtime/fail.h"
#include "runtime/gemm.h"
#include "runtime/gemm_pairs.h"
#include "runtime/rounding.h"

namespace vsplat {

void pack_panels(Context& ctx, const StridedMatrix& m, long width, bool pairs, const Tensor& out) {
  const long words = pairs ? div_up(m.k, 2L) : m.k;
  constexpr long rows = 64;  // ROWS of both files
  ctx.launch(pairs ? KernelId{"gemm_pack_pairs_cpu", "gemm_pack_panels_pairs", pair_defines(ctx)}
                   : KernelId{"gemm_cpu", "gemm_pack_panels", tile_defines(ctx.device())},
             groups(div_up(m.n, width), 1, div_up(words, rows)),
             {0, (pairs ? 6.0 : 8.0) * static_cast<double>(m.k * m.n)}, m.w, m.offset, m.first, m.k, m.n, m.k_stride,
             m.n_stride, width, written(out, div_up(m.n, width) * width * words));
}

void pack_plain(Context& ctx, const StridedMatrix& m, long piece, const Tensor& out) {
  const long side = square_side(ctx);
  ctx.launch({"gemm_gpu", "gemm_pack_plain", side == 16 ? "" : "-DPACK_SIDE=8"},
             groups(div_up(std::min(piece, m.n), side), side * side, div_up(m.k, side), div_up(m.n, piece)),
             {0, 8.0 * static_cast<double>(m.k * m.n)}, m.w, m.offset, m.first, m.k, m.n, m.k_stride, m.n_stride, piece,
             written(out, m.k * m.n));
}

std::size_t packed_bytes(Flavour flavour, long k, long n) {
  const long columns = flavour == Flavour::cpu ? div_up(n, kPanelColumns) * kPanelColumns : n;
  return static_cast<std::size_t>(k * columns) * sizeof(float);
}

PackedMatrix pack_matrix(Context& ctx, const float* w, long k, long n, long k_stride, long n_stride,
                         const std::string& what, bool exact) {
  if (ctx.flavour() == Flavour::gpu) {
    // The device transposes faster than the host.
    const long count = k * n > 0 ? (k - 1) * k_stride + (n - 1) * n_stride + 1 : 0;
    const Tensor as_stored = ctx.tensor({count}, Type::f32, what + ", unpacked");
    if (count > 0) ctx.write(as_stored, w);
    return pack_matrix(ctx, as_stored, k, n, k_stride, n_stride, what);
  }
  if (!exact && wants_pairs(ctx, k, n)) return pack_pairs(ctx, w, k, n, k_stride, n_stride, what);
  PackedMatrix out;
  out.k = k;
  out.n = n;
  const bool plain = ctx.gemm_choice() == GemmChoice::clblast;
  out.data = ctx.tensor({div_up(n, kPanelColumns), k, kPanelColumns}, Type::f32, what);
  if (plain) out.plain = ctx.tensor({k, n}, Type::f32, what);
  if (ctx.planning()) return out;
  std::vector<float> host(packed_bytes(Flavour::cpu, k, n) / sizeof(float), 0.0f);
  for_each_element(k, n, [&](long i, long j) {
    host[static_cast<std::size_t>((j / kPanelColumns * k + i) * kPanelColumns + j % kPanelColumns)] =
        w[i * k_stride + j * n_stride];
  });
  ctx.write(out.data, host.data());
  if (plain) {
    host.resize(static_cast<std::size_t>(k * n));
    for_each_element(
        k, n, [&](long i, long j) { host[static_cast<std::size_t>(i * n + j)] = w[i * k_stride + j * n_stride]; });
    ctx.write(out.plain, host.data());
  }
  return out;
}

PackedMatrix pack_matrix(Context& ctx, const Tensor& w, long k, long n, long k_stride, long n_stride,
                         const std::string& what, long first) {
  if (!w || w.type() != Type::f32 || k < 0 || n < 0 || k_stride < 0 || n_stride < 0 || first < 0 ||
      (k * n > 0 && first + (k - 1) * k_stride + (n - 1) * n_stride >= w.count()))
    fail(Status::internal, "{}: {} has no {} x {} elements from {} on with strides {} and {}", what, w.describe(), k, n,
         first, k_stride, n_stride);
  PackedMatrix out;
  out.k = k;
  out.n = n;
  const StridedMatrix from{w, first, 0, k, n, k_stride, n_stride};
  const bool panels = ctx.flavour() == Flavour::cpu;
  if (panels) {
    out.pairs = wants_pairs(ctx, k, n);
    out.data = ctx.tensor({div_up(n, kPanelColumns), out.pairs ? div_up(k, 2L) : k, kPanelColumns},
                          out.pairs ? Type::u32 : Type::f32, what);
    if (k * n > 0) pack_panels(ctx, from, kPanelColumns, out.pairs, out.data);
  }
  if (!panels || ctx.gemm_choice() == GemmChoice::clblast) {
    Tensor& plain = panels ? out.plain : out.data;
    plain = ctx.tensor({k, n}, Type::f32, what);
    if (k * n > 0) pack_plain(ctx, from, n, plain);
  }
  return out;
}

}  // namespace vsplat
