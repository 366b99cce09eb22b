// What drawing and its derivative share.
#pragma once
#include <memory>

#include "model/api/device.h"
#include "model/api/handle.h"
#include "model/api/scene.h"
#include "model/render/render.h"

namespace vsplat::api {

// A camera in front of the object, looking at it, in the object's frame: for planning, and for a first launch.
Camera any_camera(long edge);

// The scene's Gaussians on the device, placed once per scene and device, for many pictures of about `pixels` pixels.
const GaussianChunks& on_device(vsplat_device device, const std::shared_ptr<const Scene>& scene, double pixels);

// Plans drawing `count` Gaussians of that degree. Assumes that each is visible and touches eight tiles, spread evenly
// over the picture.
void plan_drawing(Context& planner, std::uint64_t count, int sh_degree, const Camera& camera,
                  GaussianKind kind = GaussianKind::volume, bool exact_tiles = false);

// Converts and checks options. Without supersampling, which drawn_as() adds and derivatives do not support.
RenderOptions options_of(const vsplat_render_options& options, const Scene& scene);
// Options for a picture from a camera in the scene's frame, with supersampling.
RenderOptions drawn_as(const vsplat_render_options& options, const Scene& scene, const Camera& view);
// Number of pixels drawn for such a picture.
double drawn_pixels(const Camera& view, const RenderOptions& how);
// Options for derivatives. Error(usage) if supersampling is requested: they are of a picture without it.
RenderOptions derived_as(const vsplat_render_options& options, const Scene& scene);

}  // namespace vsplat::api
