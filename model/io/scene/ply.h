// The standard 3DGS PLY: one vertex per Gaussian, opacity as a logit, scales as logarithms, spherical harmonics as
// f_dc_* and channel-major f_rest_*. Surfels have no scale_2, as 2DGS writes them; so both tell them from volumes.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "model/base/scene.h"

namespace vsplat {

// Single Gaussians of a file that cannot be drawn, by reason.
struct SkippedGaussians {
  std::uint64_t not_finite = 0;     // a value is NaN or infinite (but for infinite opacity logits: 0 and 1)
  std::uint64_t huge_scale = 0;     // a scale's exponential is beyond what a float holds
  std::uint64_t zero_rotation = 0;  // a quaternion of length 0

  std::uint64_t total() const { return not_finite + huge_scale + zero_rotation; }
};

// ASCII and binary of either byte order, properties in any order and of any scalar type, unknown ones and other
// elements skipped. Absent groups get rotation 1 0 0 0, log-scale -4, opacity logit 0; red, green, blue stand in for
// f_dc_*. Quaternions come out of length 1. Memory beside the scene is bounded, and nothing is made for Gaussians that
// the file is too small to hold. Damaged files throw Error(format) that names the path, the Gaussian, the property and
// its byte; bytes that nothing in the header accounts for are a warning. With `skipped`, single Gaussians that cannot
// be drawn are left out and counted there, and a warning tells how many; else the first one is an error.
Scene read_ply(const std::string& path, SkippedGaussians* skipped = nullptr);
// The same of a file's bytes in memory; `name` stands for the path in errors.
Scene read_ply(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped = nullptr);

// All floats, with normals, and the near plane, offset, up, detail, mirror point and SH degree as comments. Writes a
// temporary file and renames it. Opacities 0 and 1 become logits that every reader turns back into 0 and 1.
void write_ply(const std::string& path, const Scene& scene);

}  // namespace vsplat
