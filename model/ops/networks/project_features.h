// Features of the views at projected points, weighted by nearness (the paper's PAP).
#pragma once
#include "model/base/device_cameras.h"
#include "runtime/context.h"

namespace vsplat {

struct ProjectFeaturesForward {
  Tensor features;                         // [V, t, t, C]
  Tensor points;                           // [P, 3] in the object's frame
  const DeviceCameras* cameras = nullptr;  // V of them
  int image = 0;                           // edge of the pictures in pixels
  bool half_pixel = true;                  // add half a pixel before sampling
  bool by_distance = false;                // weights 1/distance instead of 1/depth
  Tensor out;                              // [P, C]
};

void project_features_forward(Context& ctx, const ProjectFeaturesForward& a);

// The forward's derivatives between texels; the cameras have none. A point on a texel's border or at a camera's centre
// has no derivative: it gets that of one side, and 0 for the distance.
struct ProjectFeaturesBackward {
  ProjectFeaturesForward forward;  // the forward's arguments; its `out` is ignored
  Tensor dout;                     // [P, C]
  Tensor dfeatures;                // [V, t, t, C], added to
  Tensor dpoints;                  // [P, 3], added to
};

void project_features_backward(Context& ctx, const ProjectFeaturesBackward& a);

}  // namespace vsplat
