// SPZ, the compressed format of Niantic's library: 8 to 24 bits a value, stored in the frame right, up, back. A scene
// in memory has the frame of its PLY: right, down, front.
#pragma once
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "model/base/scene.h"
#include "model/io/scene/skipped_gaussians.h"

namespace vsplat {

// Whether a file begins as SPZ does: with NGSP, or with gzip data.
bool is_spz(std::span<const std::byte> beginning);

// Reads versions 1 to 4. Only positions of version 1 can be other than finite. Errors as unpack_spz().
Scene read_spz(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped = nullptr);

// Writes version 2, 3 or 4. Positions get as many fractional bits as the scene's extent allows. Error(input) as
// volumes_to_write(), and if a position is beyond what 24 bits hold.
void write_spz(const std::string& path, const Scene& scene, int version = 4);

// How write_spz() rounds this scene in its newest version.
std::vector<std::string> spz_rounding(const Scene& scene);

}  // namespace vsplat
