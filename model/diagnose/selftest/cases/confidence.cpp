#include "model/diagnose/selftest/reference/confidence.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/networks/confidence.h"

namespace vsplat::selftest {
namespace {

void confidence_all(Checks& c) {
  for (const long p : c.some({3L, 7L, 63L, 64L, 65L, 211L}))
    for (const bool softmax : {false, true}) {
      const auto logits = random_floats(size_of(p), 1, -3, 3), x = random_floats(size_of(5 * p), 2),
                 dy = random_floats(size_of(5 * p), 3);
      const Tensor out = c.gap({p}), dx = c.gap({p, 5}), dlogits = c.gap({p});
      confidence_forward(c.ctx, {c.up({p}, logits), softmax, out});
      const auto want = ref::confidence(as_doubles(logits), softmax);
      c.close("forward", out, want, 1e-6);
      confidence_backward(c.ctx, {c.up({p, 5}, x), out, softmax, c.up({p, 5}, dy), dx, dlogits});
      std::vector<double> by;
      for (std::size_t i = 0; i < dy.size(); ++i) by.push_back(dy[i] * want[i / 5]);
      c.close("backward, dx", dx, by, 1e-6);
      c.close(
          "backward, dlogits", dlogits, [&] { return ref::confidence_backward(as_doubles(logits), softmax, x, dy); },
          2e-5);
    }
}

}  // namespace

VSPLAT_CASES(confidence, {"confidence", confidence_all})

}  // namespace vsplat::selftest
