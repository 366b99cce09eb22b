// What a picture shows besides colours: where its surfaces are, and whose they are. One sample a pixel.
#pragma once
#include <cstdint>
#include <vector>

#include "model/render/render.h"

namespace vsplat {

// Of a picture's pixels.
struct Picks {
  std::vector<float> median;      // camera z of the last Gaussian that met a transmittance over 0.5; 0 where none did
  std::vector<std::int32_t> ids;  // the nearest Gaussian with an alpha of 1/255 and more; -1 where there is none
};

// Of volumes. The device projects and sorts, the host goes through what each pixel sees until half of its light is
// taken, which is less than drawing it, but on one of the host's cores.
Picks pick(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options);

// Volumes whose picture over black is (alpha + the sum of weight x normal) / 2: each is coloured by its normal, its
// shortest axis, in the camera's axes and towards it.
Gaussians coloured_by_normals(const Gaussians& gaussians, const Camera& camera);

}  // namespace vsplat
