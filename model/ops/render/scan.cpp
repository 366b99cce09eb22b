#include "model/ops/render/scan.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kGroup = 64, kEach = 32;  // as cl/render/scan.cl

}  // namespace

void exclusive_scan(Context& ctx, const Tensor& in, const Tensor& out) {
  const long n = Dims().bind("in", in, {"n"}, Type::u32)["n"];
  Dims().set("n + 1", n + 1).bind("out", out, {"n + 1"}, Type::u32);
  if (n > (1L << 31)) fail(Status::internal, "scan of {} elements: at most 2^31 are possible", n);
  if (n == 0) {
    ctx.fill_zero(out);
    return;
  }
  const long blocks = (n + kGroup * kEach - 1) / (kGroup * kEach);
  const auto count = static_cast<unsigned>(n);
  Tensor before;
  if (blocks > 1) {
    const Tensor sums = ctx.tensor({blocks}, Type::u32, "scan.sums");
    before = ctx.tensor({blocks + 1}, Type::u32, "scan.before");
    ctx.launch({"scan", "scan_sums", ""}, groups(blocks, kGroup), {0, 4.0 * static_cast<double>(n)}, in, written(sums),
               count);
    exclusive_scan(ctx, sums, before);
  }
  ctx.launch({"scan", "scan_blocks", ""}, groups(blocks, kGroup), {0, 8.0 * static_cast<double>(n)}, in, before,
             written(out), count);
}

}  // namespace vsplat
