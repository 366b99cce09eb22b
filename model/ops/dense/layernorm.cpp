#include "model/ops/dense/layernorm.h"

#include <algorithm>

#include "runtime/column_sum.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// Rows of out come in runs of `run`, before each of which `skip` rows of x are passed over.
void launch(Context& ctx, const Tensor& x, const Tensor& gamma, const Tensor& beta, const Tensor& film,
            const Tensor& out, long rows, long c, long run, int skip, float eps) {
  if (rows == 0 || c == 0) return;
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const double values = static_cast<double>(rows) * static_cast<double>(c);
  ctx.launch({"layernorm", cpu ? "layernorm_forward_cpu" : "layernorm_forward_gpu", ""},
             cpu ? groups(rows, 1) : groups(rows, 64), {(film ? 11.0 : 8.0) * values, (film ? 16.0 : 8.0) * values}, x,
             gamma, beta, film, written(out), rows, c, run, skip, eps);
}

constexpr long kRows = 64;  // ROWS of cl/dense/layernorm.cl

// dy is [rows, c]; x, dx and dfilm as in launch().
void launch_backward(Context& ctx, const ModulateBackward& a, long rows, long c, long run, int skip) {
  if (c == 0) return;
  if (rows == 0) {
    if (!a.add) ctx.fill_zero(a.dx);
    return;
  }
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const double values = static_cast<double>(rows) * static_cast<double>(c);
  const Tensor stats = ctx.tensor({rows, 2}, Type::f32, "means and deviations");
  ctx.launch({"layernorm", cpu ? "layernorm_backward_cpu" : "layernorm_backward_gpu", ""},
             cpu ? groups(rows, 1) : groups(rows, 64),
             {(a.film ? 20.0 : 16.0) * values, (a.film ? 28.0 : 12.0) * values}, a.x, a.gamma, a.beta, a.film, a.dy,
             written(a.dx), written(a.dfilm), written(stats), rows, c, run, skip, a.eps, a.add ? 1 : 0);
  if (!a.gamma) return;
  const long sums = (rows + kRows - 1) / kRows;
  const Tensor by_gamma = ctx.tensor({sums, c}, Type::f32, "partial sums");
  const Tensor by_beta = ctx.tensor({sums, c}, Type::f32, "partial sums");
  ctx.launch({"layernorm", cpu ? "layernorm_backward_columns_cpu" : "layernorm_backward_columns_gpu", "",
              "layernorm_backward_columns"},
             cpu ? groups(sums, 1) : groups((c + 63) / 64, 64, sums),
             {(a.film ? 7.0 : 5.0) * values, (a.film ? 12.0 : 8.0) * values}, a.x, a.film, a.dy, stats,
             written(by_gamma), written(by_beta), rows, c, run, skip);
  column_sum(ctx, {by_gamma, a.dgamma, true});
  column_sum(ctx, {by_beta, a.dbeta, true});
}

// Tokens of a view that come before those that are modulated.
int left_out(const Dims& d) {
  if (d["T"] <= d["P"]) fail(Status::internal, "modulate: {} tokens without the class token of {}", d["P"], d["T"]);
  return static_cast<int>(d["T"] - d["P"]);
}

}  // namespace

void layernorm_forward(Context& ctx, const LayerNormForward& a) {
  Dims d;
  d.bind("x", a.x, {"R", "C"}).bind("out", a.out, {"R", "C"});
  if (a.gamma || a.beta) d.bind("gamma", a.gamma, {"C"}).bind("beta", a.beta, {"C"});
  launch(ctx, a.x, a.gamma, a.beta, {}, a.out, d["R"], d["C"], d["R"], 0, a.eps);
}

void layernorm_backward(Context& ctx, const LayerNormBackward& a) {
  Dims d;
  d.bind("x", a.x, {"R", "C"}).bind("dy", a.dy, {"R", "C"}).bind("dx", a.dx, {"R", "C"});
  if (a.gamma || a.dgamma || a.dbeta)
    d.bind("gamma", a.gamma, {"C"}).bind("dgamma", a.dgamma, {"C"}).bind("dbeta", a.dbeta, {"C"});
  launch_backward(ctx, {a.x, a.gamma, {}, {}, a.eps, a.dy, a.dx, {}, a.dgamma, a.dbeta, a.add}, d["R"], d["C"],
                  std::max(1L, d["R"]), 0);
}

void modulate_forward(Context& ctx, const ModulateForward& a) {
  Dims d;
  d.bind("out", a.out, {"V", "P", "C"}).bind("gamma", a.gamma, {"C"}).bind("beta", a.beta, {"C"});
  d.bind("x", a.x, {"V", "T", "C"});
  d.set("F", 2 * d["C"]).bind("film", a.film, {"V", "P", "F"});
  launch(ctx, a.x, a.gamma, a.beta, a.film, a.out, d["V"] * d["P"], d["C"], d["P"], left_out(d), a.eps);
}

void modulate_backward(Context& ctx, const ModulateBackward& a) {
  Dims d;
  d.bind("dy", a.dy, {"V", "P", "C"}).bind("gamma", a.gamma, {"C"}).bind("beta", a.beta, {"C"});
  d.bind("dgamma", a.dgamma, {"C"}).bind("dbeta", a.dbeta, {"C"});
  d.bind("x", a.x, {"V", "T", "C"}).bind("dx", a.dx, {"V", "T", "C"});
  d.set("F", 2 * d["C"]).bind("film", a.film, {"V", "P", "F"}).bind("dfilm", a.dfilm, {"V", "P", "F"});
  launch_backward(ctx, a, d["V"] * d["P"], d["C"], d["P"], left_out(d));
}

}  // namespace vsplat
