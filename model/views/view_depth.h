// The depths that are given for photographs.
#pragma once
#include <functional>
#include <vector>

#include "model/base/camera.h"
#include "model/io/views/view_set.h"

namespace vsplat {

// The depth [H,W] of each pixel of `shown`, the pinhole camera of the view's picture without its lens, in rows from the
// top; 0 where none is given. `listed` is the view's camera with its lens, resolved. May be called by several threads.
using ViewDepths = std::function<std::vector<float>(int view, const Camera& listed, const Camera& shown)>;

// From the depth pictures that the list names: camera z in the unit of the world; or if not `metric`, values from 0 to
// 1, the largest of a picture being 1. Error(input) if no view lists one; a warning counts those that do not. The
// result throws Error(file) or (format) where a picture cannot be read, Error(input) if its shape is not that of the
// view's picture. `set` must outlive it.
ViewDepths listed_depths(const ViewSet& set, bool metric);

// The camera z of the sparse points that the pictures of a COLMAP model see, at the pixels where they are. Error(input)
// if the views are not a COLMAP model's.
ViewDepths point_depths(const ViewSet& set);

}  // namespace vsplat
