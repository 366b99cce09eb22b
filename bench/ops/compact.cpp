#include "model/ops/volume/compact.h"

#include <memory>

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> compact_cases(const Options&) {
  return {
      {"voxels",
       [](Context& ctx) {
         const Tensor flags = selected_flags(ctx);
         const auto out = std::make_shared<Tensor>();
         return operation_with(
             ctx, [&ctx, flags, out] { *out = compact(ctx, flags, kSelected); }, [out] { return std::vector{*out}; });
       }},
  };
}

}  // namespace vsplat::bench
