// The configuration of VS-Splat's network with the densifier. The paper only says that M is halved. The other values
// are our choice: a candidate's feature is its voxel's refined one, and the cells are VS-Splat's voxels.
#pragma once
#include "model/networks/params/config.h"
#include "model/networks/params/densify_config.h"

namespace vsplat {

struct VsplatGendenConfig : Config {
  DensifyConfig densify;

  VsplatGendenConfig() {
    fine_count = 8;
    densify.channels = {512, 256}, densify.heads = {64, 32}, densify.cell = 1.0 / 48;
  }
  bool operator==(const VsplatGendenConfig&) const = default;
};

// paper, small (what two CPU cores train) and tiny (for tests), in this order.
const std::vector<std::string>& vsplat_genden_config_names();
VsplatGendenConfig named_vsplat_genden_config(const std::string& name);  // Error(usage) that lists the names

// As in config.h. The densifier's fields are called "densify.top_k" and so on.
void check(const VsplatGendenConfig& config, Status status = Status::usage);
void set_field(VsplatGendenConfig& config, const std::string& assignment);
std::string to_json(const VsplatGendenConfig& config);
VsplatGendenConfig vsplat_genden_config_from_json(const std::string& text, const VsplatGendenConfig& base = {});
std::vector<std::string> set_fields_from_json(VsplatGendenConfig& config, const std::string& text);
std::string field_text(const VsplatGendenConfig& config, const std::string& field);
std::vector<std::string> differing_fields(const VsplatGendenConfig& a, const VsplatGendenConfig& b,
                                          const std::vector<std::string>& fields);

}  // namespace vsplat
