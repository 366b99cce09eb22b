// What drawing and its derivative have in common.
#pragma once
#include <memory>

#include "model/api/device.h"
#include "model/api/handle.h"
#include "model/api/scene.h"
#include "model/render/render.h"

namespace vsplat::api {

// Before the object, looking at it, in the object's frame: what is planned, and launched once, with.
Camera any_camera(long edge);

// Once per scene and device: many cameras are drawn from the same one, pictures of about `pixels` pixels.
const GaussianChunks& on_device(vsplat_device device, const std::shared_ptr<const Scene>& scene, double pixels);

// Drawing so many Gaussians of that degree with a planner: each is taken to be seen and to touch eight tiles, and these
// to lie evenly in the picture.
void plan_drawing(Context& planner, std::uint64_t count, int sh_degree, const Camera& camera,
                  GaussianKind kind = GaussianKind::volume, bool exact_tiles = false);

// Checked. Without supersampling, which drawn_as() adds and derivatives do not have.
RenderOptions options_of(const vsplat_render_options& options, const Scene& scene);
// The same for a picture from a camera in the scene's frame.
RenderOptions drawn_as(const vsplat_render_options& options, const Scene& scene, const Camera& view);
// Pixels that are drawn for such a picture.
double drawn_pixels(const Camera& view, const RenderOptions& how);
// Derivatives are those of a picture without supersampling: one that is asked for is refused.
RenderOptions derived_as(const vsplat_render_options& options, const Scene& scene);

}  // namespace vsplat::api
