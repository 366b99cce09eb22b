// Geometry seen in a picture: surface depths and the Gaussians that they belong to, with one sample per pixel.
#pragma once
#include <cstdint>
#include <vector>

#include "model/render/render.h"

namespace vsplat {

// Results for a picture's pixels.
struct Picks {
  std::vector<float> median;      // camera z of the last Gaussian that met a transmittance over 0.5; 0 if none did
  std::vector<std::int32_t> ids;  // the nearest Gaussian with an alpha of at least 1/255; -1 if there is none
};

// For volumes only. The device projects and sorts. The host then blends each pixel until half of its light is absorbed.
Picks pick(Context& ctx, const GaussianChunks& scene, const Camera& camera, const RenderOptions& options);

// Volumes whose picture over black is (alpha + the sum of weight x normal) / 2. Each is coloured by its normal, which
// is its shortest axis in camera coordinates, pointing towards the camera.
Gaussians coloured_by_normals(const Gaussians& gaussians, const Camera& camera);

}  // namespace vsplat
