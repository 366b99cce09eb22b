// What the networks with a densifier share: which Gaussians are too coarse, and the densifier's weights.
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "model/networks/genden/densifier.h"
#include "model/render/render.h"

namespace vsplat {

// How much the error in the input views pulls at each Gaussian's place on the screen: [N]. `images` [V,S,S,3].
// `mirrored`: the network's negate_camera_centre.
Tensor screen_scores(Context& ctx, const DeviceGaussians& gaussians, const Tensor& images,
                     const std::vector<Camera>& cameras, const DensifyConfig& config, bool mirrored,
                     const DensifyTap& tap = {});

// Its weights' slabs are made to measure.
std::unique_ptr<Densifier> load_densifier(Context& ctx, const DensifyConfig& config, long sh_count,
                                          const WeightSource& weights);

// Calls it with each field under its golden name ("final.means").
void tap_fields(const DensifyTap& tap, const std::string& name, const DeviceGaussians& g);

}  // namespace vsplat
