#include "model/ops/activation.h"

#include <initializer_list>

#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr long kBlock = 1024;  // BLOCK of cl/activation.cl

// Of the elements that x and each of `others` have.
long checked(const char* op, const Tensor& x, Activation activation, std::initializer_list<Tensor> others) {
  if (activation == Activation::none) fail(Status::internal, "{}: no activation named", op);
  if (!x || x.type() != Type::f32) fail(Status::internal, "{}: x is {}, f32 expected", op, x.describe());
  for (const Tensor& t : others)
    if (!t || t.type() != Type::f32 || t.shape() != x.shape())
      fail(Status::internal, "{}: {} found for x {}", op, t.describe(), x.describe());
  return x.count();
}

Range range(bool cpu, long n) { return cpu ? items((n + kBlock - 1) / kBlock, 1) : items(n); }

}  // namespace

void activation_forward(Context& ctx, const ActivationForward& a) {
  const long n = checked("activation_forward", a.x, a.activation, {a.out});
  if (n == 0) return;
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const auto values = static_cast<double>(n);
  ctx.launch({"activation", cpu ? "activation_forward_cpu" : "activation_forward_gpu", ""}, range(cpu, n),
             {0, 8 * values}, a.x, written(a.out), n, static_cast<int>(a.activation));
}

void activation_backward(Context& ctx, const ActivationBackward& a) {
  const long n = checked("activation_backward", a.x, a.activation, {a.dy, a.dx});
  if (n == 0) return;
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const auto values = static_cast<double>(n);
  ctx.launch({"activation", cpu ? "activation_backward_cpu" : "activation_backward_gpu", ""}, range(cpu, n),
             {0, 12 * values}, a.x, a.dy, written(a.dx), n, static_cast<int>(a.activation));
}

}  // namespace vsplat
