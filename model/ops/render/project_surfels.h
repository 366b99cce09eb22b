// Projects surfels to the picture: project.h for surfels.
#pragma once
#include "model/ops/render/project.h"

namespace vsplat {

// The version of the original rasteriser's code to follow where they differ: the one that LaRa was trained with, or the
// later one.
enum class SurfelRevision { lara, current };

// Numbers of a surfel's record, see cl/render/project_surfels.cl.
constexpr long kSurfelRecord = 20;

// Like project_cull().
void project_surfels_cull(Context& ctx, const DeviceGaussians& chunk, long base, const Tensor& views, long view,
                          int width, int height, SurfelRevision revision, const Culled& out);

// Like ProjectForward; records [N,20].
struct ProjectSurfelsForward {
  DeviceGaussians chunk;
  long base = 0;
  Tensor views;
  long view = 0;
  Tensor ids;
  long from = 0, n = 0;
  Tensor records;
  SurfelRevision revision = SurfelRevision::lara;
};
void project_surfels_forward(Context& ctx, const ProjectSurfelsForward& a);

// Like ProjectBackward; records [N,20], rows [M,20].
struct ProjectSurfelsBackward {
  DeviceGaussians chunk;
  long base = 0;
  Tensor views;
  long view = 0;
  bool mirrored = false;
  Projected visible;
  Tensor offsets;
  IntersectionGradients intersections;
  GaussianGradients dchunk;  // added to
  Tensor pose_gradients;     // for sum_pose_gradients()
  SurfelRevision revision = SurfelRevision::lara;
};
void project_surfels_backward(Context& ctx, const ProjectSurfelsBackward& a);

}  // namespace vsplat
