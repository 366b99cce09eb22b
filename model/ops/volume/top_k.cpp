#include "model/ops/volume/top_k.h"

#include <algorithm>

#include "model/ops/render/radix_sort.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {

void top_k(Context& ctx, const TopK& a) {
  Dims d;
  d.bind("x", a.x, {"n"}).bind("flags", a.flags, {"n"}, Type::u32).bind_optional("others", a.others, {"n"}, Type::u32);
  const long n = d["n"];
  if (a.k < 0) fail(Status::internal, "top_k: the {} largest of {}", a.k, a.x.describe());
  const Tensor keys = ctx.tensor({n}, Type::u32, "top_k.keys");
  const auto count = static_cast<double>(n);
  ctx.launch({"top_k", "top_k_keys", ""}, items(n), {0, 8 * count}, a.x, written_somewhere(keys), n);
  const Sorted sorted = radix_sort(ctx, keys, {}, 32);
  ctx.launch({"top_k", "top_k_flags", ""}, items(n), {0, 12 * count}, sorted.values, written(a.flags),
             written(a.others), n, std::min(a.k, n));
}

}  // namespace vsplat
