// One picture of 512 x 512 of the scene object-190k, up to the stage whose operations are timed.
#pragma once
#include "model/ops/rasterize.h"
#include "model/ops/tile_bin.h"
#include "model/ops/visible.h"

namespace vsplat::bench {

// Culled, counted and projected.
struct Drawing {
  explicit Drawing(Context& ctx);

  ProjectForward project_all() const;         // of all that are seen
  Projected for_sorting(Context& ctx) const;  // `projected` with keys of its own, since tile_bin() uses them up
  Binned bin(Context& ctx, bool slots) const;
  RasterizeForward blend(Context& ctx, const Binned& binned) const;
  // Once the picture is drawn, from a random gradient by it.
  RasterizeBackward blend_backward(Context& ctx, const Binned& binned) const;

  DeviceGaussians gaussians;
  int width = 0, height = 0;
  Tensor views;
  Culled culled;
  Part part;  // all of it
  VisibleCount count;
  Projected projected;
};

}  // namespace vsplat::bench
