// transforms.json of NeRF-synthetic, instant-ngp and nerfstudio: camera-to-world matrices with OpenGL axes.
#pragma once
#include <nlohmann/json_fwd.hpp>

#include "model/io/view_set.h"

namespace vsplat {

// The parsed file; `path` is where it lies, which paths in it are relative to. ListedView::picture is left empty.
ViewSet parse_transforms_json(const std::filesystem::path& path, const nlohmann::json& root, bool need_pictures);

}  // namespace vsplat
