#include "model/diagnose/selftest/reference/confidence.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/networks/confidence.h"

namespace vsplat::selftest {
namespace {

void confidence_of(Checks& c, long p, long channels, bool softmax) {
  const std::size_t wide = size_of(channels);
  const auto logits = random_floats(size_of(p), 1, -3, 3), x = random_floats(size_of(p, channels), 2),
             dy = random_floats(size_of(p, channels), 3);
  const Tensor out = c.gap({p});
  confidence_forward(c.ctx, {c.up({p}, logits), softmax, out});
  const auto want = ref::confidence(as_doubles(logits), softmax);
  c.close("forward", out, want, 1e-6);
  std::vector<double> by;
  for (std::size_t i = 0; i < dy.size(); ++i) by.push_back(dy[i] * want[i / wide]);
  for (const bool in_place : c.some({false}, {true})) {
    const Tensor to = c.up({p, channels}, dy), dx = in_place ? to : c.gap({p, channels}), dlogits = c.gap({p});
    confidence_backward(c.ctx, {c.up({p, channels}, x), out, softmax, to, dx, dlogits});
    c.close("backward, dx", dx, by, 1e-6);
    // (A softmax of one point is 1 whatever its logit is.)
    const auto by_logits = [&] {
      return softmax && p == 1 ? std::vector<double>{0} : ref::confidence_backward(as_doubles(logits), softmax, x, dy);
    };
    c.close("backward, dlogits", dlogits, by_logits, 2e-5);
  }
}

void confidence_all(Checks& c) {
  for (const long p : c.some({3L, 7L, 63L, 64L, 65L, 211L}, {1L}))
    for (const bool softmax : {false, true}) confidence_of(c, p, 5, softmax);
  if (c.all) confidence_of(c, 7, 33, true);
}

}  // namespace

VSPLAT_CASES(confidence, {"confidence", confidence_all})

}  // namespace vsplat::selftest
