// What the JSON of a scene file says besides its Gaussians, in an object `vsplat` of our own that other programs
// ignore: near plane, up, mirror point, detail, offset.
#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "model/base/scene.h"

namespace vsplat {

nlohmann::json notes_of(const Scene& scene);

// Reads the object. `what` begins messages. Error(format) for a field of another type, and for one that is no distance,
// place or direction; unknown fields are ignored.
void read_notes(const std::string& what, const nlohmann::json& notes, Scene& scene);

}  // namespace vsplat
