#include "model/gaussians.h"

#include <cmath>

#include "runtime/context.h"

namespace vsplat {

Gaussians download(Context& ctx, const DeviceGaussians& g) {
  Gaussians out;
  out.count = static_cast<std::size_t>(g.count());
  out.sh_degree = static_cast<int>(std::lround(std::sqrt(static_cast<double>(g.sh.dim(1))))) - 1;
  out.means = ctx.read<float>(g.means);
  out.scales = ctx.read<float>(g.scales);
  out.quats = ctx.read<float>(g.quats);
  out.opacities = ctx.read<float>(g.opacities);
  out.sh = ctx.read<float>(g.sh);
  return out;
}

DeviceGaussians upload(Context& ctx, const Gaussians& g) {
  const long k = static_cast<long>(g.count);
  return {ctx.upload({k, 3}, g.means, Type::f32, "means"), ctx.upload({k, 3}, g.scales, Type::f32, "scales"),
          ctx.upload({k, 4}, g.quats, Type::f32, "quats"), ctx.upload({k}, g.opacities, Type::f32, "opacities"),
          ctx.upload({k, static_cast<long>(g.sh_count()), 3}, g.sh, Type::f32, "sh")};
}

}  // namespace vsplat
