#include "model/render/visibility.h"

#include <algorithm>
#include <cstdint>
#include <numeric>

#include "model/render/render.h"
#include "model/render/render_backward.h"
#include "runtime/context.h"

namespace vsplat {

// The derivative of a picture's value by a Gaussian's colour is its blending weight there. A grey copy without
// view-dependent colour keeps every colour away from its limit at 0, where that derivative ends.
std::vector<float> blending_weights(Context& ctx, const Scene& scene, std::span<const Camera> cameras,
                                    const std::function<void(std::size_t)>& begin) {
  Gaussians grey = scene.gaussians;
  grey.sh_degree = 0;
  grey.sh.assign(3 * grey.count, 0.0f);
  std::vector<float> out(grey.count, 0.0f);
  if (grey.count == 0 || cameras.empty()) return out;
  double pixels = 0;
  for (const Camera& camera : cameras)
    pixels = std::max(pixels, static_cast<double>(camera.width) * static_cast<double>(camera.height));
  RenderOptions options;
  options.near = scene.near;
  options.antialias = scene.antialias;
  const GaussianChunks placed = place_on_device(ctx, grey, pixels);
  const SceneGradient sums = zero_gradient(ctx, placed);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    begin(i);
    const long h = cameras[i].height, w = cameras[i].width;
    // Only red has a derivative, so that red's coefficient gets the weight itself.
    std::vector<float> by_colour(static_cast<std::size_t>(3 * h * w), 0.0f);
    for (std::size_t p = 0; p < by_colour.size(); p += 3) by_colour[p] = static_cast<float>(1 / kShC0);
    const PictureGradient gradient{
        ctx.upload({h, w, 3}, by_colour.data(), Type::f32, "gradient of the picture"), {}, {}};
    render_backward(ctx, placed, cameras[i], options, gradient, sums, nullptr);
  }
  const Gaussians got = download(ctx, sums, 0);
  ctx.finish();
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = got.sh[3 * k];
  return out;
}

std::vector<bool> heaviest(const std::vector<float>& weights, std::size_t most) {
  std::vector<bool> out(weights.size(), weights.size() <= most);
  if (weights.size() <= most) return out;
  std::vector<std::uint32_t> order(weights.size());
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return weights[a] > weights[b]; });
  for (std::size_t i = 0; i < most; ++i) out[order[i]] = true;
  return out;
}

}  // namespace vsplat
