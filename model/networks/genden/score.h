// Shared by the networks with a densifier: the scores that find Gaussians that are too coarse, and the densifier's
// weights.
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "model/networks/genden/densifier.h"
#include "model/render/render.h"

namespace vsplat {

// Each Gaussian's score [N]: the magnitude of the gradient of the input views' error by its screen position. `images`
// [V,S,S,3]. `mirrored`: the network's negate_camera_centre.
Tensor screen_scores(Context& ctx, const DeviceGaussians& gaussians, const Tensor& images,
                     const std::vector<Camera>& cameras, const DensifyConfig& config, bool mirrored,
                     const DensifyTap& tap = {});

// Allocates slabs of the exact size for its weights.
std::unique_ptr<Densifier> load_densifier(Context& ctx, const DensifyConfig& config, long sh_count,
                                          const WeightSource& weights);

// Calls `tap` with each field under its golden name ("final.means").
void tap_fields(const DensifyTap& tap, const std::string& name, const DeviceGaussians& g);

}  // namespace vsplat
