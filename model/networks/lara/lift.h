// LaRa's lifting: what each view shows at the centres of a grid, every view by itself, with the learned embedding of
// the view's number beside it.
#pragma once
#include "model/base/device_cameras.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/lara_layers.h"

namespace vsplat {

class LaraLifting {
 public:
  // Takes "view_embed".
  LaraLifting(Context& ctx, const LaraConfig& config, const WeightSource& weights);

  struct Saved {
    DeviceCameras cameras;
    Shape features;  // [V, t, t, C]
  };
  // features [V, t, t, C] -> rows [r^3 V, C + E] in two sources, the views of a voxel one after the other: the samples,
  // and the embeddings, which repeat.
  RowSource forward(Context& ctx, const Tensor& features, const DeviceCameras& cameras, Saved* saved = nullptr) const;
  // By the rows: dsamples [r^3 V, C], dembedded [r^3 V, E] -> dfeatures [V, t, t, C], which is written. Adds to the
  // gradient by the embeddings.
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
