#include "model/ops/networks/confidence.h"

#include "runtime/shape_check.h"

namespace vsplat {

void confidence_forward(Context& ctx, const ConfidenceForward& a) {
  Dims d;
  d.bind("logits", a.logits, {"P"}).bind("confidence", a.confidence, {"P"});
  const long p = d["P"];
  if (p == 0) return;
  const double count = static_cast<double>(p);
  const KernelId id{"confidence", a.softmax ? "confidence_forward_softmax" : "confidence_forward", ""};
  ctx.launch(id, a.softmax ? groups(1, 64) : items(p), {10 * count, 8 * count}, a.logits, written(a.confidence), p);
}

void confidence_backward(Context& ctx, const ConfidenceBackward& a) {
  Dims d;
  d.bind("x", a.x, {"P", "C"}).bind("dy", a.dy, {"P", "C"}).bind("dx", a.dx, {"P", "C"});
  d.bind("confidence", a.confidence, {"P"}).bind("dlogits", a.dlogits, {"P"});
  const long p = d["P"], c = d["C"];
  if (p == 0) return;
  const double count = static_cast<double>(p), values = count * static_cast<double>(c);
  const Tensor by_confidence = ctx.tensor({p}, Type::f32, "confidence.gradient");
  ctx.launch({"confidence", "confidence_backward", ""}, items(p), {3 * values, 12 * values}, a.x, a.confidence, a.dy,
             written(a.dx), written(by_confidence), p, c);
  ctx.launch({"confidence", "confidence_backward_logits", ""}, groups(1, 64), {5 * count, 12 * count}, a.confidence,
             by_confidence, written(a.dlogits), p, a.softmax ? 1 : 0);
}

}  // namespace vsplat
