#include "model/ops/layernorm.h"

#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// Rows of out come in runs of `run`, before each of which `skip` rows of x are passed over.
void launch(Context& ctx, const Tensor& x, const Tensor& gamma, const Tensor& beta, const Tensor& film,
            const Tensor& out, long rows, long c, long run, int skip, float eps) {
  if (rows == 0 || c == 0) return;
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const double values = static_cast<double>(rows) * static_cast<double>(c);
  ctx.launch({"layernorm", cpu ? "layernorm_cpu" : "layernorm_gpu", ""}, cpu ? groups(rows, 1) : groups(rows, 64),
             {(film ? 11.0 : 8.0) * values, (film ? 16.0 : 8.0) * values}, x, gamma, beta, film, out,
             static_cast<int>(rows), static_cast<int>(c), static_cast<int>(run), skip, eps);
}

}  // namespace

void layernorm_forward(Context& ctx, const LayerNormForward& a) {
  Dims d;
  d.bind("x", a.x, {"R", "C"}).bind("gamma", a.gamma, {"C"}).bind("beta", a.beta, {"C"}).bind("out", a.out, {"R", "C"});
  launch(ctx, a.x, a.gamma, a.beta, {}, a.out, d["R"], d["C"], d["R"], 0, a.eps);
}

void modulate_forward(Context& ctx, const ModulateForward& a) {
  Dims d;
  d.bind("out", a.out, {"V", "P", "C"}).bind("gamma", a.gamma, {"C"}).bind("beta", a.beta, {"C"});
  // Labels that begin with a digit mean that size, so these two are checked by hand.
  if (a.x.shape() != Shape{d["V"], 1 + d["P"], d["C"]} || a.film.shape() != Shape{d["V"], d["P"], 2 * d["C"]})
    fail(Status::internal, "modulate: x {}, film {} found for out {}", a.x.describe(), a.film.describe(),
         a.out.describe());
  launch(ctx, a.x, a.gamma, a.beta, a.film, a.out, d["V"] * d["P"], d["C"], d["P"], 1, a.eps);
}

}  // namespace vsplat
