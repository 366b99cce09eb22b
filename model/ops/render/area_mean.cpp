#include "model/ops/render/area_mean.h"

#include "runtime/fail.h"

namespace vsplat {

void area_mean(Context& ctx, const AreaMean& a) {
  const std::size_t rank = a.out.shape().size();
  const bool fits = (rank == 2 || rank == 3) && a.x.shape().size() == rank && a.k >= 1 && a.x.type() == Type::f32 &&
                    a.out.type() == Type::f32 && a.x.dim(0) == a.k * a.out.dim(0) && a.x.dim(1) == a.k * a.out.dim(1) &&
                    (rank == 2 || a.x.dim(2) == a.out.dim(2));
  if (!fits) fail(Status::internal, "area_mean: {} by {} into {}", a.x.describe(), a.k, a.out.describe());
  const double values = static_cast<double>(a.out.count()), read = static_cast<double>(a.x.count());
  ctx.launch({"area_mean", "area_mean", ""}, items(a.out.count()), {read, 4 * (read + values)}, a.x, written(a.out),
             a.out.dim(0), a.out.dim(1), rank == 3 ? a.out.dim(2) : 1L, a.k);
}

}  // namespace vsplat
