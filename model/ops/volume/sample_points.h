// The views' maps at points: bilinear samples of view_maps.h's maps, with the drawn depth as its distance from the
// point's own.
#pragma once
#include "model/base/device_cameras.h"
#include "runtime/context.h"

namespace vsplat {

struct SamplePointsForward {
  Tensor maps;                             // [V, S, S, 8]
  Tensor points;                           // [P, 3] in the object's frame
  const DeviceCameras* cameras = nullptr;  // V of them, of pictures of S x S pixels
  bool half_pixel = true;                  // add half a pixel before sampling
  Tensor out;                              // [P, V, 8]
};
void sample_points_forward(Context& ctx, const SamplePointsForward& a);

// The forward's derivatives between pixels; the cameras have none.
struct SamplePointsBackward {
  SamplePointsForward forward;  // the forward's arguments; its `out` is ignored
  Tensor dout;                  // [P, V, 8]
  Tensor dpoints;               // [P, 3], added to
  Tensor dmaps;                 // [V, S, S, 8], added to; or none
};
void sample_points_backward(Context& ctx, const SamplePointsBackward& a);

}  // namespace vsplat
