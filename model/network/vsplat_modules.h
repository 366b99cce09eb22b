// The network's stages, and what passes between its two halves: for the sources of VsplatModel alone.
#pragma once
#include "model/network/head.h"
#include "model/network/lift.h"
#include "model/network/modulation.h"
#include "model/network/refine.h"
#include "model/network/select.h"
#include "model/network/unet3d.h"
#include "model/network/vit.h"
#include "model/network/vsplat_model.h"

namespace vsplat {

struct VsplatModel::Modules {
  Vit encoder;
  PoseModulation modulation;
  Lifting lifting;
  VolumeNetwork volume;
  CoarseHeads coarse_heads;
  Refinement refinement;
  FineHeads fine_heads;

  Modules(Context& ctx, const Config& config, const WeightSource& weights)
      : encoder(ctx, config, weights),
        modulation(ctx, config, weights),
        lifting(ctx, config, weights),
        volume(ctx, config, weights),
        coarse_heads(ctx, config, weights),
        refinement(ctx, config, weights),
        fine_heads(ctx, config, weights) {}
};

// What the coarse half leaves to the fine one.
struct VsplatModel::Coarse {
  Tensor features;            // [V,t,t,C]
  Tensor volume;              // [R^3,C~]
  DeviceGaussians gaussians;  // R^3, opacities refined by the confidence
  SelectedVoxels selected;    // none where `levels` is "coarse"
};

// What each stage keeps.
struct VsplatModel::Saved {
  // What stages are run again from; nothing else is then kept of them, but of the selection.
  struct Inputs {
    Tensor images, tokens, features, volume;
    DeviceCameras cameras;
    DeviceGaussians skeleton;  // where `levels` is "fine", as is `index`
    Tensor index;
  };
  std::optional<Inputs> again;

  Vit::Saved encoder;
  PoseModulation::Saved modulation;
  Lifting::Saved lifting;
  VolumeNetwork::Saved volume_network;
  CoarseHeads::Saved coarse_heads;
  SelectionSaved selection;
  Refinement::Saved refinement;
  FineHeads::Saved fine_heads;
  Shape features, volume;  // whose gradients are sums
};

}  // namespace vsplat
