#include "model/base/gaussians.h"

#include <cmath>

#include "runtime/context.h"

namespace vsplat {

int DeviceGaussians::sh_degree() const {
  return sh ? static_cast<int>(std::lround(std::sqrt(static_cast<double>(sh.dim(1))))) - 1 : 0;
}

GaussianKind DeviceGaussians::kind() const {
  return scales && scales.dim(1) == scales_of(GaussianKind::surfel) ? GaussianKind::surfel : GaussianKind::volume;
}

GaussianGradients zero_gradients(Context& ctx, long count, int sh_degree, GaussianKind kind) {
  const auto zeros = [&](const Shape& shape, const char* what) {
    Tensor out = ctx.tensor(shape, Type::f32, what);
    ctx.fill_zero(out);
    return out;
  };
  return {zeros({count, 3}, "gradient.means"), zeros({count, scales_of(kind)}, "gradient.scales"),
          zeros({count, 4}, "gradient.quats"), zeros({count}, "gradient.opacities"),
          zeros({count, static_cast<long>(sh_degree + 1) * (sh_degree + 1), 3}, "gradient.sh")};
}

Gaussians download(Context& ctx, const DeviceGaussians& g) {
  Gaussians out;
  out.count = static_cast<std::size_t>(g.count());
  out.sh_degree = g.sh_degree();
  out.kind = g.kind();
  out.means = ctx.read<float>(g.means);
  out.scales = ctx.read<float>(g.scales);
  out.quats = ctx.read<float>(g.quats);
  out.opacities = ctx.read<float>(g.opacities);
  out.sh = ctx.read<float>(g.sh);
  return out;
}

DeviceGaussians upload(Context& ctx, const Gaussians& g) { return upload(ctx, g, 0, static_cast<long>(g.count)); }

DeviceGaussians upload(Context& ctx, const Gaussians& g, long first, long n) {
  const long s = static_cast<long>(g.drawn_sh_count()), axes = scales_of(g.kind);
  const auto from = [first](const std::vector<float>& v, long each) {
    return v.empty() ? nullptr : v.data() + first * each;  // (vectors are empty in a plan)
  };
  std::vector<float> drawn;  // without the coefficients that are not drawn
  if (!g.sh.empty() && g.sh_degree > kDrawnDegree) {
    drawn.reserve(static_cast<std::size_t>(3 * n * s));
    for (long k = first; k < first + n; ++k) {
      const float* one = from(g.sh, 0) + 3 * k * static_cast<long>(g.sh_count());
      drawn.insert(drawn.end(), one, one + 3 * s);
    }
  }
  return {ctx.upload({n, 3}, from(g.means, 3), Type::f32, "means"),
          ctx.upload({n, axes}, from(g.scales, axes), Type::f32, "scales"),
          ctx.upload({n, 4}, from(g.quats, 4), Type::f32, "quats"),
          ctx.upload({n}, from(g.opacities, 1), Type::f32, "opacities"),
          ctx.upload({n, s, 3}, drawn.empty() ? from(g.sh, 3 * s) : drawn.data(), Type::f32, "sh")};
}

}  // namespace vsplat
