// Mixed precision of the cpu flavour: products of pairs of operands that are rounded to bf16 (cl/dense/pairs_cpu.clh),
// by the processor's instructions or emulated. A matrix is rounded where it is packed, so PackedMatrix::pairs decides
// about a product; the other operand is rounded on its way into scratch memory.
#pragma once
#include "runtime/gemm.h"

namespace vsplat {

// For trials and tests: during its life, what this thread packs for the cpu flavour are pairs, in any precision and of
// any size.
class AlwaysPairs {
 public:
  AlwaysPairs();
  ~AlwaysPairs();
  AlwaysPairs(const AlwaysPairs&) = delete;
  AlwaysPairs& operator=(const AlwaysPairs&) = delete;
};

// Whether a matrix [k, n] is packed as pairs: in mixed precision of the cpu flavour, unless a side is so short that
// packing would not pay off (see wants_matrix()).
bool wants_pairs(const Context& ctx, long k, long n);

// The defines of kernels that multiply pairs by the context's unit: with and without them, a kernel has the same
// arguments.
std::string pair_defines(const Context& ctx);

// Whether AMX multiplies the context's pairs (cl/dense/amx.clh): its tiles are of other shapes, so their kernels are
// others, too, but for what is packed once.
bool multiplies_by_amx(const Context& ctx);
constexpr long kAmxRows = 32;    // rows of a tile of cl/dense/gemm_amx_cpu.cl
constexpr long kPairBlock = 16;  // pairs of a block of cl/dense/gemm_pack_pairs_cpu.cl

// Packs rows [first, first + rows) of w [.., m] as the columns of the first operand of gemm_amx_tile.
void pack_columns_for_amx(Context& ctx, const Tensor& w, long first, long rows, long m, const Tensor& out);

// pack_matrix() to pairs, whatever the context's precision and the sizes are.
PackedMatrix pack_pairs(Context& ctx, const float* w, long k, long n, long k_stride, long n_stride,
                        const std::string& what);

}  // namespace vsplat
