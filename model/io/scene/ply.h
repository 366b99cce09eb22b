// The standard 3DGS PLY: one vertex per Gaussian, opacity as a logit, scales as logarithms, spherical harmonics as
// f_dc_* and channel-major f_rest_*. Surfels have no scale_2, as in 2DGS files; this distinguishes them from volumes.
#pragma once
#include <cstddef>
#include <span>
#include <string>

#include "model/base/scene.h"
#include "model/io/scene/skipped_gaussians.h"

namespace vsplat {

// Reads ASCII and binary of either byte order, with properties in any order and of any scalar type; unknown properties
// and other elements are skipped. Absent groups get rotation 1 0 0 0, log-scale -4, opacity logit 0; red, green, blue
// replace absent f_dc_*. Quaternions are normalised. Memory besides the scene is bounded, and none is allocated for
// Gaussians that the file is too small to hold. Damaged files throw Error(format) with the path, the Gaussian, the
// property and its byte; bytes beyond what the header describes cause a warning. With `skipped`, Gaussians that cannot
// be drawn are omitted and counted there, and a warning reports their number; without it, the first one is an error.
Scene read_ply(const std::string& path, SkippedGaussians* skipped = nullptr);
// Reads a file's bytes in memory; `name` replaces the path in errors.
Scene read_ply(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped = nullptr);

// Writes all properties as float, with normals; the near plane, offset, up, detail, mirror point, anti-aliasing and SH
// degree as comments. Writes a temporary file and renames it. Opacities 0 and 1 become logits that every reader
// converts back to 0 and 1.
void write_ply(const std::string& path, const Scene& scene);

}  // namespace vsplat
