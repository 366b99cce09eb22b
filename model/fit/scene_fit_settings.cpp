// The settings of a fit in effect: a line for each option.
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "model/fit/scene_fit_impl.h"
#include "model/views/placement.h"

namespace vsplat {
namespace {

using nlohmann::ordered_json;

ordered_json freeze_of(const FitFreeze& freeze) {
  std::string out;
  for (const auto& [name, on] :
       {std::pair("means", freeze.means), std::pair("scales", freeze.scales), std::pair("rotations", freeze.rotations),
        std::pair("opacities", freeze.opacities), std::pair("sh", freeze.sh)})
    if (on) out += (out.empty() ? "" : ",") + std::string(name);
  return out.empty() ? ordered_json() : ordered_json(out);
}

const char* quality_name(FitQuality quality) {
  return quality == FitQuality::high ? "high" : quality == FitQuality::normal ? "normal" : "draft";
}

std::string background_text(const FitBackground& background) {
  using Kind = FitBackground::Kind;
  const std::array<float, 3>& c = background.colour;
  return background.kind == Kind::random   ? "random"
         : background.kind == Kind::sky    ? "sky"
         : background.kind == Kind::colour ? fmt::format("{},{},{}", c[0], c[1], c[2])
                                           : "auto";
}

template <class T>
ordered_json or_null(bool known, const T& value) {
  return known ? ordered_json(value) : ordered_json();
}

}  // namespace

std::string SceneFit::settings() const {
  const Impl& i = *impl_;
  const FitRequest& r = i.request;
  const Placement& frame = i.given.placement;
  // Names are those of `vsplat fit`'s options. Given back, a value gives the same fit: where views are left out in
  // turn, the number of steps is found out, and is not given.
  const bool finds_steps = i.phases.size() > 1 || i.unknown;
  const bool grows = i.recipe.options.grow_every > 0;
  const Camera largest = i.pictures.largest(i.used);
  ordered_json out = {
      {"steps", or_null(r.steps > 0 || !finds_steps, r.steps > 0 ? r.steps : i.recipe.steps)},
      {"time", or_null(r.seconds > 0, r.seconds)},
      {"quality", quality_name(r.quality)},
      {"size", r.longest > 0 ? ordered_json(r.longest) : ordered_json("full")},
      {"max-gaussians", or_null(r.max_gaussians > 0, r.max_gaussians)},
      {"strategy", r.density == DensityStrategy::error ? "error" : "mcmc"},
      {"consolidate", or_null(r.consolidate > 0, r.consolidate)},
      {"sh", i.degree},
      {"freeze", freeze_of(r.freeze)},
      {"seed", r.seed},
      {"antialias", i.recipe.options.antialias},
      {"background", background_text(r.background)},
      {"masks", i.photographs.masks == MaskUse::ignore ? "ignore" : "object"},
      {"invert-masks", i.photographs.invert_masks},
      {"depth", or_null(r.depth_weight > 0, r.depth)},
      {"depth-weight", or_null(r.depth_weight > 0, static_cast<double>(r.depth_weight))},
      {"poses", r.poses},
      {"exposure", r.exposure},
  };
  out["derived"] = {
      {"extent", r.whole ? "scene" : "object"},
      {"max_gaussians", or_null(grows, i.recipe.options.max_gaussians)},
      {"consolidate", i.recipe.consolidate},
      {"picture", {largest.width, largest.height}},
      {"center", {frame.centre.x(), frame.centre.y(), frame.centre.z()}},
      {"scale", frame.edge * i.given.cube},
  };
  return out.dump();
}

}  // namespace vsplat
