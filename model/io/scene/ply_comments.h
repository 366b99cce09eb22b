// The comments of a PLY that say how its Gaussians are drawn, and where they lie.
#pragma once
#include <string>

#include "model/base/scene.h"
#include "model/io/scene/ply_header.h"

namespace vsplat {

// Reads the comments that vsplat writes, and SplatRenderMode, which several programs write. Error(format) for one that
// is damaged.
void read_comments(const std::string& path, const PlyHeader& header, GaussianKind kind, Scene& scene);

// The lines of a header for everything of the scene but its Gaussians.
std::string comments_of(const Scene& scene);

}  // namespace vsplat
