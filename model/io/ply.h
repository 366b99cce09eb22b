// The standard 3DGS PLY: one vertex per Gaussian, opacity as a logit, scales as logarithms, spherical harmonics as
// f_dc_* and channel-major f_rest_*.
#pragma once
#include <string>

#include "model/scene.h"

namespace vsplat {

// binary_little_endian, properties in any order and of any scalar type, unknown ones and other elements skipped. Absent
// groups get rotation 1 0 0 0, log-scale -4, opacity logit 0; red, green, blue stand in for f_dc_*. Quaternions come
// out of length 1. Damaged files throw Error(format) that names the path, the Gaussian, the property and its byte;
// bytes that nothing in the header accounts for are a warning.
Scene read_ply(const std::string& path);

// All floats, with normals, and the near plane, the mirror point and the SH degree as comments. Writes a temporary file
// and renames it. Opacities 0 and 1 become logits that every reader turns back into 0 and 1.
void write_ply(const std::string& path, const Scene& scene);

}  // namespace vsplat
