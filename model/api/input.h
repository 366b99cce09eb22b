#pragma once
#include <memory>
#include <string>
#include <vector>

#include "model/api/handle.h"
#include "model/views/input.h"

namespace vsplat::api {

// What options structs share. Error(usage) for invalid values.
Crop crop_of(const vsplat_crop& crop);
MaskUse masks_of(const vsplat_masks& masks);
std::vector<std::string> names_of(const char* const* names, std::size_t count, const std::string& what);
PlacementRequest placement_of(bool has_centre, const double (&centre)[3], double edge, bool auto_frame);
InputRequest request_of(const vsplat_input_options& options);
// Up direction in the world, from all listed cameras.
Eigen::Vector3d listed_up(const Photographs& photographs);

}  // namespace vsplat::api

struct vsplat_views_impl : vsplat::api::Counted {
  vsplat::Photographs photographs;
};

struct vsplat_input_impl : vsplat::api::Counted {
  vsplat::Input input;
  Eigen::Vector3d up = Eigen::Vector3d::Zero();  // up direction in the world, from all listed cameras
};
