// The ray of each patch: the Pluecker vector through its centre, as spherical harmonics to degree 3.
#pragma once
#include "model/base/device_cameras.h"

namespace vsplat {

struct PluckerForward {
  DeviceCameras cameras;  // V of them
  int patch = 0;          // pixels
  Tensor out;             // [V, t, t, 32]: 16 values of the ray's unit direction d, 16 of its moment o x d
};

void plucker_forward(Context& ctx, const PluckerForward& a);

}  // namespace vsplat
