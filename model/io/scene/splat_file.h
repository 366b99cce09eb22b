// The .splat file of the first web viewers: 32 bytes a Gaussian and no header, without spherical harmonics.
#pragma once
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "model/base/scene.h"
#include "model/io/scene/skipped_gaussians.h"

namespace vsplat {

// Whether the beginning of a file is that of a .splat, which has no signature: its first Gaussians have finite
// positions, scales from 0 up, and rotations of about length 1.
bool is_splat(std::span<const std::byte> beginning);

// Error(format) if the size is no multiple of 32 bytes, and for a Gaussian that cannot be drawn, unless `skipped`
// counts it.
Scene read_splat(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped = nullptr);

// Writes the Gaussians by size times opacity, largest first. Error(input) as volumes_to_write().
void write_splat(const std::string& path, const Scene& scene);

// How write_splat() rounds this scene.
std::vector<std::string> splat_rounding(const Scene& scene);

namespace splat {

// Bytes of a Gaussian, and where its colour and its rotation begin among them.
inline constexpr std::size_t kRow = 32, kColour = 24, kRotation = 28;

}  // namespace splat

}  // namespace vsplat
