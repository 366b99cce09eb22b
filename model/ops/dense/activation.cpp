#include "model/ops/dense/activation.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kBlock = 1024;  // BLOCK of cl/dense/activation.cl

void check(const char* op, const Tensor& x, Activation activation) {
  if (activation == Activation::none) fail(Status::internal, "{}: no activation named", op);
  if (!x || x.type() != Type::f32) fail(Status::internal, "{}: x is {}, f32 expected", op, x.describe());
}

Range range(bool cpu, long n) { return cpu ? items((n + kBlock - 1) / kBlock, 1) : items(n); }

}  // namespace

void activation_forward(Context& ctx, const ActivationForward& a) {
  check("activation_forward", a.x, a.activation);
  Dims().like("out", a.out, "x", a.x);
  const long n = a.x.count();
  if (n == 0) return;
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const auto values = static_cast<double>(n);
  ctx.launch({"activation", cpu ? "activation_forward_cpu" : "activation_forward_gpu", ""}, range(cpu, n),
             {0, 8 * values}, a.x, written(a.out), n, static_cast<int>(a.activation));
}

void activation_backward(Context& ctx, const ActivationBackward& a) {
  check("activation_backward", a.x, a.activation);
  Dims().like("dy", a.dy, "x", a.x).like("dx", a.dx, "x", a.x);
  const long n = a.x.count();
  if (n == 0) return;
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const auto values = static_cast<double>(n);
  ctx.launch({"activation", cpu ? "activation_backward_cpu" : "activation_backward_gpu", ""}, range(cpu, n),
             {0, 12 * values}, a.x, a.dy, written(a.dx), n, static_cast<int>(a.activation));
}

}  // namespace vsplat
