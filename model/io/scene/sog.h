// SOG, PlayCanvas' format of 3D Gaussians: lossless WebP planes with one texel for each Gaussian, and a meta.json that
// says what their bytes mean; in a zip archive, or beside each other in a folder. Positions have 16 bits an axis after
// a logarithm, scales and colours an index into a codebook of 256 values, the higher spherical harmonics one into a
// palette of vectors.
#pragma once
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "model/base/scene.h"
#include "model/io/scene/skipped_gaussians.h"

namespace vsplat {

// Reads an archive of version 1 or 2; `name` is its path in messages. Error(format) for a missing or damaged entry, a
// plane that has fewer texels than Gaussians, and a field of another type; messages name the entry and the field. A
// Gaussian that cannot be drawn is an error, unless `skipped` counts it. Memory is reserved from the host budget first.
Scene read_sog(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped = nullptr);

// Reads a folder by the path of its meta.json, whose planes are beside it.
Scene read_sog_folder(const std::string& meta_path, SkippedGaussians* skipped = nullptr);

// Writes an archive of version 2, with spherical harmonics up to degree 3. Gaussians are sorted along a Morton curve;
// surfels become volumes, see volumes_to_write(), whose Error(input) this throws, too. Near plane, up, mirror point,
// detail and offset are in the object `vsplat` of meta.json.
void write_sog(const std::string& path, const Scene& scene);

// How write_sog() rounds this scene.
std::vector<std::string> sog_rounding(const Scene& scene);

}  // namespace vsplat
