// The configuration of GenDen's network: LaRa's with one Gaussian in each voxel, followed by the densifier. The
// defaults are the published sizes.
#pragma once
#include "model/networks/params/densify_config.h"
#include "model/networks/params/lara_config.h"

namespace vsplat {

struct GendenConfig : LaraConfig {
  DensifyConfig densify;

  GendenConfig() { kind = "gaussian", primitives = 1, fine_heads = 16, fine_hidden = 80, fine_features = 80; }
  bool operator==(const GendenConfig&) const = default;
};

// published, published_residual (its second model), small (what two CPU cores train), tiny and micro (for tests), in
// this order.
const std::vector<std::string>& genden_config_names();
GendenConfig named_genden_config(const std::string& name);  // Error(usage) that lists the names

// As in config.h. The densifier's fields are called "densify.top_k" and so on.
void check(const GendenConfig& config, Status status = Status::usage);
void set_field(GendenConfig& config, const std::string& assignment);
std::string to_json(const GendenConfig& config);
GendenConfig genden_config_from_json(const std::string& text, const GendenConfig& base = {});
std::vector<std::string> set_fields_from_json(GendenConfig& config, const std::string& text);
std::string field_text(const GendenConfig& config, const std::string& field);
std::vector<std::string> differing_fields(const GendenConfig& a, const GendenConfig& b,
                                          const std::vector<std::string>& fields);

}  // namespace vsplat
