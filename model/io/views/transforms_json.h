// transforms.json of NeRF-synthetic, instant-ngp and nerfstudio (camera-to-world matrices with OpenGL axes), and the
// camera paths that nerfstudio's viewer writes.
#pragma once
#include <nlohmann/json_fwd.hpp>

#include "model/io/views/view_set.h"

namespace vsplat {

// Interprets parsed JSON; `path` is the file's location, to which paths in it are relative. Masks stay as listed, and
// ListedView::picture stays empty. An error in a single frame becomes its problem.
ViewSet parse_transforms_json(const std::filesystem::path& path, const nlohmann::json& root, bool need_pictures);

// nerfstudio's camera_path.json: cameras to render from.
ViewSet parse_camera_path(const std::filesystem::path& path, const nlohmann::json& root);

}  // namespace vsplat
