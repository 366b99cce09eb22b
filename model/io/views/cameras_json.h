// Two formats share the name cameras.json and differ in their keys: ours, {file, w, h, fx, fy, cx, cy, w2c}, a lossless
// interchange format, and the INRIA viewers' {id, img_name, width, height, position, rotation, fy, fx}.
#pragma once
#include <nlohmann/json_fwd.hpp>

#include "model/io/views/view_set.h"

namespace vsplat {

// Interprets parsed JSON of either format. ListedView::picture stays empty.
ViewSet parse_cameras_json(const std::filesystem::path& path, const nlohmann::json& root, bool need_pictures);

// Writes our format with 17 digits, so that reading gives the same doubles; replaces an existing file atomically. The
// format only holds pinhole cameras without distortion.
void write_cameras(const std::filesystem::path& path, const std::vector<Camera>& cameras);

}  // namespace vsplat
