// PlayCanvas compressed PLY: blocks of 256 Gaussians with bounds, four packed integers a Gaussian, and bytes of
// spherical harmonics.
#pragma once
#include <string>
#include <vector>

#include "model/base/scene.h"
#include "model/io/scene/ply_file.h"
#include "model/io/scene/skipped_gaussians.h"

namespace vsplat {

// Whether the vertices have packed_position.
bool is_compressed_ply(const PlyHeader& header);

// Reads the file behind such a header. The bounds of colours and the spherical harmonics
// may be missing. Errors as read_ply().
Scene read_compressed_ply(PlyFile& in, const PlyHeader& header, SkippedGaussians* skipped);

// Writes the Gaussians along a space-filling curve, so that those of a block lie together; degree 4 is cut to 3. The
// comments are those of write_ply(). Error(input) as volumes_to_write().
void write_compressed_ply(const std::string& path, const Scene& scene);

// How write_compressed_ply() rounds this scene.
std::vector<std::string> compressed_ply_rounding(const Scene& scene);

namespace compressed_ply {

inline constexpr std::size_t kBlockSize = 256;  // Gaussians
// Properties of a block: the lowest and the highest position, logarithm of the scale, and colour.
inline constexpr const char* kBounds[] = {
    "min_x",       "min_y",       "min_z",       "max_x", "max_y", "max_z", "min_scale_x", "min_scale_y", "min_scale_z",
    "max_scale_x", "max_scale_y", "max_scale_z", "min_r", "min_g", "min_b", "max_r",       "max_g",       "max_b"};
inline constexpr std::size_t kNumBounds = 18;
// Packed from the highest bits on: 11, 10 and 11 bits; 2 for the largest of w x y z and 10 for each of the others; 11,
// 10 and 11; 8 for red, green, blue and opacity.
inline constexpr const char* kPacked[] = {"packed_position", "packed_rotation", "packed_scale", "packed_color"};

}  // namespace compressed_ply

}  // namespace vsplat
