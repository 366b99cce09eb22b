// How much of the pictures each Gaussian shows.
#pragma once
#include <functional>
#include <span>
#include <vector>

#include "model/base/camera.h"
#include "model/base/scene.h"

namespace vsplat {

class Context;

// The sum of each Gaussian's blending weights (its alpha times the transmittance in front of it) over all pixels of the
// cameras' pictures, one sample a pixel. `cameras` are in the frame of the scene. `begin` is called before each
// picture with its number; it may throw.
std::vector<float> blending_weights(Context& ctx, const Scene& scene, std::span<const Camera> cameras,
                                    const std::function<void(std::size_t)>& begin);

// Which Gaussians stay if the `most` with the largest weights do, of equal ones the first.
std::vector<bool> heaviest(const std::vector<float>& weights, std::size_t most);

}  // namespace vsplat
