// One picture of 512 x 512 of the scene object-190k, up to the stage whose operations are timed.
#pragma once
#include <vector>

#include "model/ops/render/rasterize.h"
#include "model/ops/render/rasterize_surfels.h"
#include "model/ops/render/tile_bin.h"
#include "model/ops/render/visible.h"

namespace vsplat::bench {

// What volumes and surfels share: culled and counted.
struct Culling {
  Culling(Context& ctx, GaussianKind kind);

  Projected for_sorting(Context& ctx) const;  // `projected` with keys of its own, since tile_bin() uses them up
  Binned bin(Context& ctx, bool slots) const;
  DevicePicture picture(Context& ctx, const SurfelMaps& maps = {}) const {
    return make_picture(ctx, width, height, maps);
  }

  DeviceGaussians gaussians;
  int width = 0, height = 0;
  Tensor views;
  Culled culled;
  Part part;  // all of it
  VisibleCount count;
  Projected projected;  // without records
};

// Projected, too.
struct Drawing : Culling {
  explicit Drawing(Context& ctx);

  ProjectForward project_all() const;  // of all that are seen
  RasterizeForward blend(Context& ctx, const Binned& binned) const;
  // Once the picture is drawn, from a random gradient by it.
  RasterizeBackward blend_backward(Context& ctx, const Binned& binned) const;
};

// The same without the third of each scale, with all maps.
struct SurfelDrawing : Culling {
  explicit SurfelDrawing(Context& ctx);

  ProjectSurfelsForward project_all() const;
  RasterizeSurfelsForward blend(Context& ctx, const Binned& binned) const;
  RasterizeSurfelsBackward blend_backward(Context& ctx, const Binned& binned) const;
};

// What a backward pass wrote: rows that no pixel touched hold what was there before, and are zeros here.
std::vector<Tensor> written_rows(Context& ctx, const IntersectionGradients& gradients);

}  // namespace vsplat::bench
