// VS-Splat's stages, and the data between its two halves. Included only by the sources of VsplatModel.
#pragma once
#include <optional>

#include "model/networks/layers/checkpointed.h"
#include "model/networks/layers/vit.h"
#include "model/networks/vsplat/fused_lift.h"
#include "model/networks/vsplat/head.h"
#include "model/networks/vsplat/pose_modulation.h"
#include "model/networks/vsplat/ray_predictor.h"
#include "model/networks/vsplat/unet3d.h"
#include "model/networks/vsplat/voxel_refiner.h"
#include "model/networks/vsplat/voxel_selection.h"
#include "model/networks/vsplat/vsplat_model.h"

namespace vsplat {

struct VsplatModel::Modules {
  Vit encoder;
  std::optional<RayPredictor> rays;  // if poses are predicted
  PoseModulation modulation;
  Lifting lifting;
  VolumeNetwork volume;
  CoarseHeads coarse_heads;
  Refinement refinement;
  FineHeads fine_heads;

  Modules(Context& ctx, const Config& config, const WeightSource& weights)
      : encoder(ctx, config.encoder_sizes(), weights),
        modulation(ctx, config, weights),
        lifting(ctx, config, weights),
        volume(ctx, config, weights),
        coarse_heads(ctx, config, weights),
        refinement(ctx, config, weights),
        fine_heads(ctx, config, weights) {
    if (config.predicts_poses()) rays.emplace(ctx, config, weights);
  }
};

// Results of the coarse half that the fine half needs.
struct VsplatModel::Coarse {
  Tensor tokens;              // [V,P+t t,C]; in training only
  Tensor rays;                // [V,t,t,6] if predicted
  Tensor features;            // [V,t,t,C]
  Tensor volume;              // [R^3,C~]
  DeviceGaussians gaussians;  // R^3, opacities refined by the confidence
  SelectedVoxels selected;    // empty if `levels` is "coarse"
};

// What backward needs from each stage. Lifting and volume network are recomputed together, since the tensor between
// them is larger than the inputs of both; so are refinement and fine heads.
struct VsplatModel::Saved {
  struct Volume {
    Lifting::Saved lifting;
    VolumeNetwork::Saved network;
  };
  struct Fine {
    Refinement::Saved refinement;
    FineHeads::Saved heads;
  };

  explicit Saved(bool recompute)
      : encoder(recompute),
        rays(recompute),
        modulation(recompute),
        volume(recompute),
        coarse_heads(recompute),
        fine(recompute) {}

  Checkpointed<Vit::Saved> encoder;
  Checkpointed<RayPredictor::Saved> rays;
  Checkpointed<PoseModulation::Saved> modulation;
  Checkpointed<Volume> volume;
  Checkpointed<CoarseHeads::Saved> coarse_heads;
  SelectionSaved selection;
  Checkpointed<Fine> fine;
  DeviceCameras cameras;               // for the stages that run again
  Shape features_shape, volume_shape;  // tensors whose gradients are sums
};

}  // namespace vsplat
