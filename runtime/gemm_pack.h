// Packs matrices for the products of gemm.h: what its sources share.
#pragma once
#include <algorithm>

#include "runtime/context.h"

namespace vsplat {

constexpr long kPanelRows = 12, kPanelColumns = 32;  // of cl/dense/tile_cpu.clh

// A matrix [k, n] on the device: element (i, j) is w's element offset + (first + i) * k_stride + j * n_stride.
struct StridedMatrix {
  Tensor w;
  long offset, first, k, n, k_stride, n_stride;
};

// Packs into panels of `width` columns: [ceil(n / width), k, width], or if `pairs` is set, u32 [ceil(n / width), ceil(k
// / 2), width], pairs of rounded operands (gemm_pairs.h).
void pack_panels(Context& ctx, const StridedMatrix& m, long width, bool pairs, const Tensor& out);

// Packs into [ceil(n / piece)] matrices [k, piece], the last of which may be narrower.
void pack_plain(Context& ctx, const StridedMatrix& m, long piece, const Tensor& out);

// Calls visit(i, j) for i < k and j < n, in blocks small enough for a transposition to stay in the first-level cache.
template <class Visit>
void for_each_element(long k, long n, const Visit& visit) {
  constexpr long block = 32;
  for (long i0 = 0; i0 < k; i0 += block)
    for (long j0 = 0; j0 < n; j0 += block)
      for (long i = i0; i < std::min(i0 + block, k); ++i)
        for (long j = j0; j < std::min(j0 + block, n); ++j) visit(i, j);
}

}  // namespace vsplat
