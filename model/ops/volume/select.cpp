#include "model/ops/volume/select.h"

#include "model/base/rng.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

void check_temperature(Selection selection, float temperature) {
  if (selection == Selection::gumbel && !(temperature > 0)) {
    fail(Status::usage, "the selection's temperature is {}; it must be above 0", temperature);
  }
}

}  // namespace

Selection selection_of(const std::string& name) {
  if (name == "gumbel") return Selection::gumbel;
  if (name == "sigmoid") return Selection::sigmoid;
  if (name == "ste") return Selection::ste;
  if (name == "opacity") return Selection::opacity;
  fail(Status::usage, "selection is gumbel, sigmoid, ste or opacity, not \"{}\"", name);
}

void select_forward(Context& ctx, const SelectForward& a) {
  Dims d;
  d.bind("opacities", a.opacities, {"n"}).bind_optional("noise", a.noise, {"n"});
  if (a.logits || a.selection != Selection::opacity) d.bind("logits", a.logits, {"n"});
  d.bind_optional("factor", a.factor, {"n"}).bind_optional("refined", a.refined, {"n"});
  d.bind("flags", a.flags, {"n"}, Type::u32);
  check_temperature(a.selection, a.temperature);
  const long n = d["n"];
  const auto count = static_cast<double>(n);
  ctx.launch({"select", "select_forward", ""}, items(n, 64), {10 * count, 24 * count}, a.logits, a.noise, a.opacities,
             written(a.factor), written(a.refined), written(a.flags), n, static_cast<int>(a.selection), a.temperature,
             a.opacity_threshold);
}

void select_backward(Context& ctx, const SelectBackward& a) {
  Dims d;
  d.bind("logits", a.logits, {"n"}).bind_optional("noise", a.noise, {"n"}).bind("opacities", a.opacities, {"n"});
  d.bind("drefined", a.drefined, {"n"}).bind_optional("dlogits", a.dlogits, {"n"});
  d.bind("dopacities", a.dopacities, {"n"});
  check_temperature(a.selection, a.temperature);
  const long n = d["n"];
  const auto count = static_cast<double>(n);
  ctx.launch({"select", "select_backward", ""}, items(n, 64), {12 * count, 24 * count}, a.logits, a.noise, a.opacities,
             a.drefined, written(a.dlogits), written(a.dopacities), n, static_cast<int>(a.selection), a.temperature);
}

void logistic_noise(Context& ctx, const Tensor& noise, std::uint64_t seed, std::uint32_t step, std::uint32_t stream) {
  const long n = Dims().bind("noise", noise, {"n"})["n"];
  const auto key = rng_key(seed);
  const auto count = static_cast<double>(n);
  ctx.launch({"select", "select_noise", ""}, items(n, 64), {100 * count, 4 * count}, written(noise), n,
             static_cast<unsigned>(step), static_cast<unsigned>(stream), static_cast<unsigned>(key[0]),
             static_cast<unsigned>(key[1]));
}

}  // namespace vsplat
