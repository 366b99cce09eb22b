#include "runtime/gemm_pairs.h"

#include <algorithm>

#include "runtime/bfloat16.h"
#include "runtime/gemm_matrix.h"
#include "runtime/gemm_pack.h"
#include "runtime/rounding.h"

namespace vsplat {

namespace {
thread_local int always = 0;
}  // namespace

AlwaysPairs::AlwaysPairs() { ++always; }
AlwaysPairs::~AlwaysPairs() { --always; }

bool wants_pairs(const Context& ctx, long k, long n) {
  if (ctx.flavour() != Flavour::cpu || ctx.device().native_float_width < 4) return false;
  return always > 0 || wants_matrix(ctx, k, n, n);
}

std::string pair_defines(const Context& ctx) {
  return is_of_processor(ctx.matrix_unit()) ? "-DPAIRS -DMATRIX_AVX512BF16" : "-DPAIRS";
}

bool multiplies_by_amx(const Context& ctx) { return ctx.matrix_unit() == MatrixUnit::amx; }

void pack_columns_for_amx(Context& ctx, const Tensor& w, long first, long rows, long m, const Tensor& out) {
  const long blocks = div_up(rows, 32L), panels = div_up(m, kAmxRows);
  ctx.launch({"gemm_amx_cpu", "gemm_amx_pack_columns", pair_defines(ctx)}, groups(blocks, 1, 2 * panels),
             {0, 6.0 * static_cast<double>(rows * m)}, w, first, rows, m,
             written(out, panels * kAmxRows * blocks * 16));
}

PackedMatrix pack_pairs(Context& ctx, const float* w, long k, long n, long k_stride, long n_stride,
                        const std::string& what) {
  const long pairs = div_up(k, 2L);
  PackedMatrix out;
  out.k = k, out.n = n, out.pairs = true;
  out.data = ctx.tensor({div_up(n, kPanelColumns), pairs, kPanelColumns}, Type::u32, what);
  if (ctx.planning()) return out;
  std::vector<std::uint32_t> host(static_cast<std::size_t>(out.data.count()), 0u);
  for_each_element(pairs, n, [&](long i, long j) {
    const float* first = w + 2 * i * k_stride + j * n_stride;
    const std::uint32_t second = 2 * i + 1 < k ? to_bfloat16(first[k_stride]) : 0u;
    host[static_cast<std::size_t>((j / kPanelColumns * pairs + i) * kPanelColumns + j % kPanelColumns)] =
        to_bfloat16(*first) | second << 16;
  });
  ctx.write(out.data, host.data());
  return out;
}

}  // namespace vsplat
