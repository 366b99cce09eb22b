#include "model/ops/fit/splat_parameters.h"

#include "model/base/rng.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// Dropping, converted to the kernels' arguments.
struct Drop {
  explicit Drop(const Dropping& d)
      : below(static_cast<unsigned>(static_cast<double>(d.share) * 4294967296.0)),
        draw(d.draw),
        key(rng_key(d.seed)),
        raise(1 / (1 - d.share)) {
    if (!(d.share >= 0) || !(d.share < 1))
      fail(Status::internal, "splat_parameters: a share of {} left out, 0 up to 1 expected", d.share);
  }
  unsigned below, draw, stream = stream_of("fit.dropping");
  std::array<std::uint32_t, 2> key;
  float raise;
};

constexpr long kBlock = 256;  // BLOCK of cl/fit/splat_parameters.cl

Range range(bool cpu, long count) { return cpu ? items((count + kBlock - 1) / kBlock, 1) : items(3 * count); }

void bind(Dims& d, const SplatParameters& x) {
  d.bind("means", x.means, {"K", "3"}).bind("log_scales", x.log_scales, {"K", "3"}).bind("quats", x.quats, {"K", "4"});
  d.bind("logits", x.logits, {"K"}).bind("sh", x.sh, {"K", "S", "3"});
}

}  // namespace

void splat_parameters_forward(Context& ctx, const SplatParametersForward& a) {
  Dims d;
  bind(d, a.x);
  d.bind("scales", a.scales, {"K", "3"}).bind("opacities", a.opacities, {"K"});
  const Drop drop(a.dropping);
  const auto count = static_cast<double>(d["K"]);
  const bool cpu = ctx.flavour() == Flavour::cpu;
  ctx.launch({"splat_parameters", cpu ? "splat_parameters_forward_cpu" : "splat_parameters_forward_gpu", ""},
             range(cpu, d["K"]), {40 * count, 32 * count}, a.x.log_scales, a.x.logits, written(a.scales),
             written(a.opacities), d["K"], drop.below, drop.draw, drop.stream, drop.key[0], drop.key[1], drop.raise);
}

void splat_parameters_backward(Context& ctx, const SplatParametersBackward& a) {
  Dims d;
  bind(d, a.x);
  d.bind("dmeans", a.dgaussians.means, {"K", "3"}).bind("dscales", a.dgaussians.scales, {"K", "3"});
  d.bind("dopacities", a.dgaussians.opacities, {"K"});
  d.bind_optional("home_means", a.home_means, {"K", "3"}).bind_optional("home_scales", a.home_scales, {"K", "3"});
  if (static_cast<bool>(a.home_means) != static_cast<bool>(a.home_scales))
    fail(Status::internal, "splat_parameters_backward: home_means and home_scales are given together or not at all");
  const Drop drop(a.dropping);
  const auto count = static_cast<double>(d["K"]);
  const bool cpu = ctx.flavour() == Flavour::cpu;
  ctx.launch({"splat_parameters", cpu ? "splat_parameters_backward_cpu" : "splat_parameters_backward_gpu", ""},
             range(cpu, d["K"]), {50 * count, 72 * count}, a.x.log_scales, a.x.logits, a.x.means, a.home_means,
             a.home_scales, written(a.dgaussians.means), written(a.dgaussians.scales), written(a.dgaussians.opacities),
             d["K"], drop.below, drop.draw, drop.stream, drop.key[0], drop.key[1], drop.raise, a.opacity_weight,
             a.scale_weight, a.pull);
}

}  // namespace vsplat
