// LaRa's stages, and the data between its two halves. Included only by the sources of LaraModel.
#pragma once
#include "model/networks/lara/decoder.h"
#include "model/networks/lara/lara_model.h"
#include "model/networks/lara/ray_modulation.h"
#include "model/networks/lara/view_lift.h"
#include "model/networks/lara/volume.h"
#include "model/networks/layers/checkpointed.h"
#include "model/networks/layers/vit.h"

namespace vsplat {

struct LaraModel::Modules {
  Vit encoder;
  LaraModulation modulation;
  LaraLifting lifting;
  LaraVolume volume;
  LaraCoarseDecoder coarse_decoder;
  LaraFineDecoder fine_decoder;

  Modules(Context& ctx, const LaraConfig& config, const WeightSource& weights)
      : encoder(ctx, config.encoder_sizes(), weights, "img_encoder"),
        modulation(ctx, config, weights),
        lifting(ctx, config, weights),
        volume(ctx, config, weights),
        coarse_decoder(ctx, config, weights),
        fine_decoder(ctx, config, weights) {}
};

// Results of the coarse half that the fine half needs.
struct LaraModel::Coarse {
  DeviceCameras cameras;
  Tensor tokens;              // [V,1+t t,C]; in training only
  Tensor volume;              // [(2R)^3,C]
  DeviceGaussians gaussians;  // K (2R)^3
  Tensor index;               // i32 [P]: indices of the kept primitives
  Tensor maps;                // [V,S,S,8]: samples of the views, see model/ops/networks/view_maps.h
};

// What backward needs from each stage.
struct LaraModel::Saved {
  explicit Saved(bool recompute)
      : encoder(recompute), modulation(recompute), volume(recompute), coarse_decoder(recompute) {}

  Checkpointed<Vit::Saved> encoder;
  Checkpointed<LaraModulation::Saved> modulation;
  LaraLifting::Saved lifting;
  LaraVolume::Saved volume;
  Checkpointed<LaraCoarseDecoder::Saved> coarse_decoder;
  Shape volume_shape;
  LaraFineDecoder::Input fine;
  Tensor index;
  DeviceCameras cameras;  // for the stages that run again
  // What is rendered again, and with which cameras; empty if renderings were given.
  DeviceGaussians drawn;
  std::vector<Camera> drawn_from;
};

}  // namespace vsplat
