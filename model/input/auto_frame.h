// Finding the object from the cameras, and from masks where there are any.
#pragma once
#include <optional>
#include <span>

#include "model/base/image.h"
#include "model/base/pixel_rows.h"
#include "model/input/placement.h"

namespace vsplat {

// What of a picture is the object, in its pixels.
struct MaskExtent {
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

// The box that holds all of a mask's visible pixels (last channel over one half) but 0.2 % at each side, which a few
// stray pixels do not widen; nothing where no pixel is visible.
std::optional<MaskExtent> mask_extent(const Image& mask);
std::optional<MaskExtent> mask_extent(PixelRows& mask);

// Intrinsics must be known. `extents`: one per camera or none at all; lens distortion is not undone for them.
// The centre is the point nearest to the optical axes, or, where two or more views have a mask, to the rays through the
// middles of the masks; by the sum of distances, so that a camera that looks elsewhere counts little. The edge is 1.2
// times the largest extent of the masks at the centre's depth (the 90th percentile of the views), else such that 1.5
// edges fill a picture at the median distance and field of view; in no case does the cube reach a camera. `centre`:
// settled already, only the edge is estimated. Error(input) where the axes meet nowhere.
EstimatedPlacement auto_frame(std::span<const Camera> cameras, std::span<const std::optional<MaskExtent>> extents = {},
                              const std::optional<Eigen::Vector3d>& centre = {});

}  // namespace vsplat
