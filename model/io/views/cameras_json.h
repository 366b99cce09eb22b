// Two formats share the name cameras.json and are told apart by their keys: ours {file, w, h, fx, fy, cx, cy, w2c}, the
// lossless interchange, and that of the INRIA viewers {id, img_name, width, height, position, rotation, fy, fx}.
#pragma once
#include <nlohmann/json_fwd.hpp>

#include "model/io/views/view_set.h"

namespace vsplat {

// The parsed file, either format. ListedView::picture is left empty.
ViewSet parse_cameras_json(const std::filesystem::path& path, const nlohmann::json& root, bool need_pictures);

// Ours, with 17 digits so that reading gives the same doubles; replaces an existing file in one step. The format holds
// pinholes without distortion only.
void write_cameras(const std::filesystem::path& path, const std::vector<Camera>& cameras);

}  // namespace vsplat
