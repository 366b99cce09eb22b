// transforms.json of NeRF-synthetic, instant-ngp and nerfstudio: camera-to-world matrices with OpenGL axes;
// and the paths of cameras that nerfstudio's viewer writes.
#pragma once
#include <nlohmann/json_fwd.hpp>

#include "model/io/views/view_set.h"

namespace vsplat {

// The parsed file; `path` is where it lies, which paths in it are relative to. Masks are left as
// listed, and ListedView::picture is left empty. What is wrong with a single frame becomes its problem.
ViewSet parse_transforms_json(const std::filesystem::path& path, const nlohmann::json& root, bool need_pictures);

// nerfstudio's camera_path.json: cameras to draw from.
ViewSet parse_camera_path(const std::filesystem::path& path, const nlohmann::json& root);

}  // namespace vsplat
