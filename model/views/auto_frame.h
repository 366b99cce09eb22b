// Locates the object from a scene's points, from masks, or from the cameras alone.
#pragma once
#include <optional>
#include <span>

#include "model/base/image.h"
#include "model/base/pixel_rows.h"
#include "model/io/views/colmap_points.h"
#include "model/views/placement.h"

namespace vsplat {

// The object's bounding box in a picture, in pixels.
struct MaskExtent {
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
};

// The bounding box of a mask's visible pixels (last channel over one half) without 0.2 % at each side, so that stray
// pixels do not widen it; nothing if no pixel is visible.
std::optional<MaskExtent> mask_extent(const Image& mask);
std::optional<MaskExtent> mask_extent(PixelRows& mask);

// The point nearest to the optical axes, by the sum of distances; nothing where they are parallel.
std::optional<Eigen::Vector3d> where_axes_meet(std::span<const Camera> cameras);

// Intrinsics must be known. `extents`: one per camera or none at all; lens distortion is not undone for them.
// `points`: in the cameras' world; none where there are none. The cube is, of these the first that there is enough of:
// 1. that of cube_of_points(). Where it is more than 1.5 times as large as by the masks, the points show what lies
//    around the object, too, and those alone count that nine in ten of the masks hold.
// 2. The centre is the point nearest to the rays through the middles of two masks or more, by the sum of distances, so
//    that a camera that looks elsewhere counts little; the edge is 1.2 times the largest extent of the masks at the
//    centre's depth (the 90th percentile of the views).
// 3. The centre is the point nearest to the optical axes; the edge is such that 1.5 edges fill a picture at the median
//    distance and field of view.
// In no case does the cube reach a camera. `centre`: settled already, only the edge is estimated. Error(input) where
// the axes meet nowhere.
EstimatedPlacement auto_frame(std::span<const Camera> cameras, std::span<const std::optional<MaskExtent>> extents = {},
                              const std::optional<Eigen::Vector3d>& centre = {},
                              std::span<const ColoredPoint> points = {});

}  // namespace vsplat
