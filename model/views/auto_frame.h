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

// The point with the smallest sum of distances to the optical axes; nothing if they are parallel.
std::optional<Eigen::Vector3d> where_axes_meet(std::span<const Camera> cameras);

// Estimates the object's cube. Intrinsics must be known. `extents`: one per camera, or empty; lens distortion is not
// undone for them. `points`: in the cameras' world; may be empty. Uses the first of these sources that suffices:
// 1. The points: cube_of_points(). If that cube is more than 1.5 times as large as the masks suggest, the points also
//    show the object's surroundings; then only points inside at least nine in ten masks are used.
// 2. The masks: the centre is the point with the smallest sum of distances to the rays through the middles of at least
//    two masks, so that a camera that looks elsewhere has little influence. The edge is 1.2 times the largest extent of
//    the masks at the centre's depth (the 90th percentile of the views).
// 3. The cameras: the centre is the point nearest to the optical axes. The edge is chosen so that 1.5 edges fill a
//    picture at the median distance and field of view.
// The cube never reaches a camera. With `centre`, only the edge is estimated. Error(input) if the axes do not meet.
// the axes meet nowhere.
EstimatedPlacement auto_frame(std::span<const Camera> cameras, std::span<const std::optional<MaskExtent>> extents = {},
                              const std::optional<Eigen::Vector3d>& centre = {},
                              std::span<const ColoredPoint> points = {});

}  // namespace vsplat
