// One weight of the encoder's.
#include "model/ops/fit/muon.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> muon_cases(const Options&) {
  return {
      {"step",
       [](Context& ctx) {
         MuonStep a;
         a.param = random(ctx, {3072, 768}, 1), a.grad = random(ctx, {3072, 768}, 2), a.m = random(ctx, {3072, 768}, 3);
         return operation(ctx, [&ctx, a] { muon_step(ctx, a); }, {a.param, a.m});
       }},
  };
}

}  // namespace vsplat::bench
