// Whether a whole forward is right: every layer of every stage at sampled outputs, against sums in double of what the
// device gave that layer. What is between the layers, which a forward does not keep, a training's forward of each stage
// keeps; its results are held to those of the forward, all of them.
#pragma once
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/base/device_cameras.h"
#include "model/networks/vsplat/vsplat_model.h"

namespace vsplat::bench {

// What a forward was given.
struct ModelInput {
  Config config;  // with DINO's encoder, and known poses
  Weights weights;
  std::vector<Camera> cameras;
  std::vector<int> selection;
  std::vector<float> pictures;  // [V, S, S, 3]
  Tensor images;                // the same
  DeviceCameras views;
};

// Input for a named configuration: pictures of a drawn scene, random weights without zeros, a tenth of the voxels
// selected.
ModelInput model_input(Context& ctx, const std::string& config);

// The worst error, relative to the largest value of its kind. If `worst` is not null, it is set to the layer's name.
double model_error(Context& ctx, const ModelInput& in, const VsplatModel& model, std::string* worst = nullptr);

}  // namespace vsplat::bench
