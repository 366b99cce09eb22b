// LaRa's lifting: samples each view at the centres of a grid, separately for each view, and appends the learned
// embedding of the view's number.
#pragma once
#include "model/base/device_cameras.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/lara_layers.h"

namespace vsplat {

class LaraLifting {
 public:
  // Loads "view_embed".
  LaraLifting(Context& ctx, const LaraConfig& config, const WeightSource& weights);

  struct Saved {
    DeviceCameras cameras;
    Shape features;  // [V, t, t, C]
  };
  // features [V, t, t, C] -> rows [r^3 V, C + E] in two sources, with a voxel's views in consecutive rows: the samples,
  // and the repeated embeddings.
  RowSource forward(Context& ctx, const Tensor& features, const DeviceCameras& cameras, Saved* saved = nullptr) const;
  // Gradients by the rows, dsamples [r^3 V, C] and dembedded [r^3 V, E] -> dfeatures [V, t, t, C], which is
  // overwritten. Adds to the gradient of the embeddings.
  Tensor backward(Context& ctx, const Saved& saved, const Tensor& dsamples, const Tensor& dembedded) const;

 private:
  struct Corners {
    Tensor index, weight;  // [r^3, V, 4]
  };
  Corners corners(Context& ctx, const DeviceCameras& cameras) const;

  LaraConfig config_;
  LaraViewLayers<WeightLoader> layers_;
};

}  // namespace vsplat
