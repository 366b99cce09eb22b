#include "model/networks/params/genden_config.h"

#include <fmt/ranges.h>

#include "model/networks/params/field_list.h"
#include "model/networks/params/lara_fields.h"
#include "model/networks/params/params.h"

namespace vsplat {

template <class Visit>
static void each_field(GendenConfig& c, const Visit& visit) {
  each_lara_field(static_cast<LaraConfig&>(c), visit);
  each_densify_field(c.densify, visit, false);
}
template <class Visit>
static void each_field(const GendenConfig& c, const Visit& visit) {
  each_lara_field(static_cast<const LaraConfig&>(c), visit);
  each_densify_field(c.densify, visit, false);
}

const std::vector<std::string>& genden_config_names() {
  static const std::vector<std::string> names = {"published", "published_residual", "small", "tiny", "micro"};
  return names;
}

GendenConfig named_genden_config(const std::string& name) {
  GendenConfig c;
  if (name == "published") return c;
  if (name == "published_residual") {
    c.densify.residual = true;
    return c;
  }
  if (name != "small" && name != "tiny" && name != "micro")
    fail(Status::usage, "no configuration of GenDen's is called {}; there are {}", json_fields::shown(name),
         fmt::join(genden_config_names(), ", "));
  static_cast<LaraConfig&>(c) = named_lara_config(name);
  c.kind = "gaussian", c.primitives = 1;
  DensifyConfig& d = c.densify;
  d.cell = 1.0 / c.grid();
  if (name == "small") {
    c.fine_features = c.out_ch;
    d.top_k = 3000, d.channels = {2 * c.out_ch, 96}, d.heads = {2 * c.out_ch / 8, 12};
  } else if (name == "tiny") {
    c.fine_heads = 3, c.fine_hidden = 14, c.fine_features = 12;
    d.top_k = 85, d.channels = {24, 32}, d.heads = {3, 4}, d.patch = {16, 16}, d.frequencies = 6;
  } else {
    c.fine_features = 6;
    d.top_k = 9, d.channels = {12, 8}, d.heads = {2, 2}, d.depths = {1, 2}, d.patch = {4, 4};
    d.mlp_ratio = 2, d.upscale = {2, 2}, d.frequencies = 3;
  }
  return c;
}

void check(const GendenConfig& c, Status status) {
  check(static_cast<const LaraConfig&>(c), status);
  const FieldChecks is(status);
  check(c.densify, is);
  is.need(c.kind == "gaussian", "kind must be gaussian: surfels are not densified", c.kind);
  is.need(c.densify.channels[0] == c.fine_features + c.out_ch,
          "densify.channels must begin with fine_features + out_ch",
          fmt::format("{} and {} + {}", c.densify.channels[0], c.fine_features, c.out_ch));
  for (const Parameter& parameter : parameters(c))
    is.indexable(("the elements of " + parameter.name).c_str(), static_cast<double>(parameter.count()));
}

void set_field(GendenConfig& config, const std::string& assignment) { field_list::set(config, assignment); }

std::string to_json(const GendenConfig& config) { return field_list::text_of(field_list::object_of(config)); }

std::vector<std::string> set_fields_from_json(GendenConfig& config, const std::string& text) {
  return field_list::set_from_json(config, text);
}

GendenConfig genden_config_from_json(const std::string& text, const GendenConfig& base) {
  GendenConfig config = base;
  set_fields_from_json(config, text);
  check(config, Status::format);
  return config;
}

std::string field_text(const GendenConfig& config, const std::string& field) {
  return field_list::field_text(config, field);
}

std::vector<std::string> differing_fields(const GendenConfig& a, const GendenConfig& b,
                                          const std::vector<std::string>& fields) {
  return field_list::differing(a, b, fields);
}

}  // namespace vsplat
