// Gaussians in glTF 2.0, by the extension KHR_gaussian_splatting: a primitive of points whose attributes are positions,
// rotations, scales, opacities and spherical harmonics. As JSON (.gltf) or with its buffer in one file (.glb). Meshes
// are read elsewhere, by the reader program.
//
// glTF's axes are x left, y up, z towards the viewer where a scene's are x right, y down: a half turn about z lies
// between them, which changes signs alone. The nodes above a primitive are applied to positions, scales, rotations and
// spherical harmonics.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "model/base/scene.h"
#include "model/io/scene/skipped_gaussians.h"

namespace vsplat {

// Whether the beginning of a file is that of a GLB.
bool is_glb(std::span<const std::byte> beginning);
// The version that a GLB's header states; 0 if the file ends before.
std::uint32_t glb_version(std::span<const std::byte> beginning);

// Reads JSON or GLB. Attributes may be floats or normalised integers; buffers are the GLB's or in data: URIs. All
// Gaussians of the file's scene come in one list. Error(format), naming the field, for a missing buffer, one that ends
// early, sparse accessors, compressed Gaussians, and nodes that are no rotation, shift and even scale. A Gaussian that
// cannot be drawn is an error, unless `skipped` counts it. Memory is reserved from the host budget first.
Scene read_gltf_scene(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped = nullptr);
// The same from a path: buffers may also be files beside it.
Scene read_gltf_file(const std::string& path, SkippedGaussians* skipped = nullptr);

// Write one primitive of floats, which keep every bit, with spherical harmonics up to degree 3, and for other programs
// COLOR_0 in linear light. Surfels become volumes, see volumes_to_write(), whose Error(input) these throw, too. Near
// plane, up, mirror point, detail and offset are in the object `vsplat` of the file's extras.
void write_gltf_scene(const std::string& path, const Scene& scene);  // the buffer as a data: URI
void write_glb_scene(const std::string& path, const Scene& scene);

}  // namespace vsplat
