#include "model/ops/volume/compact.h"

#include "model/ops/render/scan.h"
#include "runtime/shape_check.h"

namespace vsplat {

Tensor compact(Context& ctx, const Tensor& flags, long planned) {
  const long n = Dims().bind("flags", flags, {"n"}, Type::u32)["n"];
  const auto count = static_cast<unsigned>(n);
  const Tensor positions = ctx.tensor({n + 1}, Type::u32, "compact.positions");
  exclusive_scan(ctx, flags, positions);
  long selected = planned;
  {
    const Tensor total = ctx.tensor({1}, Type::u32, "compact.total");
    ctx.launch({"compact", "compact_total", ""}, items(1, 1), {0, 8}, positions, written(total), count);
    // The host sizes everything that follows by it.
    if (!ctx.planning()) selected = ctx.read<std::uint32_t>(total)[0];
  }
  Tensor indices = ctx.tensor({selected}, Type::i32, "compact.indices");
  ctx.launch({"compact", "compact_indices", ""}, items(n, 64), {0, 8.0 * static_cast<double>(n)}, flags, positions,
             written(indices), count);
  return indices;
}

}  // namespace vsplat
