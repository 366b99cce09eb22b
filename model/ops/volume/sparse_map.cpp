#include "model/ops/volume/sparse_map.h"

#include "runtime/shape_check.h"

namespace vsplat {

void sparse_map_forward(Context& ctx, const SparseMapForward& a) {
  Dims d;
  d.bind("index", a.index, {"P"}, Type::i32).bind("map", a.map, {"P", "27"}, Type::i32);
  const long p = d["P"], r = a.volume;
  const Tensor grid = ctx.tensor({r * r * r}, Type::i32, "sparse_map.grid");
  ctx.fill_zero(grid);
  const auto count = static_cast<double>(p);
  ctx.launch({"sparse_map", "sparse_map_grid", ""}, items(p, 64), {0, 8 * count}, a.index, written(grid), p);
  ctx.launch({"sparse_map", "sparse_map_forward", ""}, items(p, 64), {0, 220 * count}, a.index, grid, written(a.map), p,
             r);
}

}  // namespace vsplat
