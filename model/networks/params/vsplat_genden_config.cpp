#include "model/networks/params/vsplat_genden_config.h"

#include <fmt/ranges.h>

#include "model/networks/params/field_list.h"
#include "model/networks/params/params.h"

namespace vsplat {

// Only the densifier's fields: VS-Splat's are handled elsewhere.
template <class Visit>
static void each_field(DensifyConfig& c, const Visit& visit) {
  each_densify_field(c, visit, true);
}
template <class Visit>
static void each_field(const DensifyConfig& c, const Visit& visit) {
  each_densify_field(c, visit, true);
}

namespace {

bool of_densifier(const std::string& field) { return field.starts_with("densify."); }

}  // namespace

const std::vector<std::string>& vsplat_genden_config_names() {
  static const std::vector<std::string> names = {"paper", "small", "tiny"};
  return names;
}

VsplatGendenConfig named_vsplat_genden_config(const std::string& name) {
  VsplatGendenConfig c;
  DensifyConfig& d = c.densify;
  if (name == "paper") return c;
  if (name == "small") {
    static_cast<Config&>(c) = named_config(name);
    c.fine_count = 4;
    d.top_k = 3000, d.channels = {c.fine_dim, 128}, d.heads = {32, 16}, d.cell = 1.0 / c.volume;
  } else if (name == "tiny") {
    static_cast<Config&>(c) = named_config(name);
    c.image = 24, c.patch = 4, c.fine_dim = 24, c.fine_count = 2;
    d.top_k = 85, d.channels = {24, 32}, d.heads = {3, 4}, d.patch = {16, 16}, d.frequencies = 6;
    d.cell = 1.0 / c.volume;
  } else {
    fail(Status::usage, "no configuration of VS-Splat with GenDen is called {}; there are {}", json_fields::shown(name),
         fmt::join(vsplat_genden_config_names(), ", "));
  }
  return c;
}

void check(const VsplatGendenConfig& c, Status status) {
  check(static_cast<const Config&>(c), status);
  const FieldChecks is(status);
  check(c.densify, is);
  is.need(c.levels == "fine", "levels must be fine: its Gaussians are what is densified", c.levels);
  is.need(c.densify.channels[0] == c.fine_dim, "densify.channels must begin with fine_dim",
          fmt::format("{} and {}", c.densify.channels[0], c.fine_dim));
  for (const Parameter& parameter : parameters(c))
    is.indexable(("the elements of " + parameter.name).c_str(), static_cast<double>(parameter.count()));
}

void set_field(VsplatGendenConfig& config, const std::string& assignment) {
  if (of_densifier(assignment))
    field_list::set(config.densify, assignment);
  else
    set_field(static_cast<Config&>(config), assignment);
}

std::string to_json(const VsplatGendenConfig& config) {
  nlohmann::ordered_json out = nlohmann::ordered_json::parse(to_json(static_cast<const Config&>(config)));
  out.update(field_list::object_of(config.densify));
  return field_list::text_of(out);
}

std::vector<std::string> set_fields_from_json(VsplatGendenConfig& config, const std::string& text) {
  const nlohmann::json object = parse_json("the configuration", text);
  if (!object.is_object()) fail(Status::format, "the configuration is not a JSON object: {}", json_fields::shown(text));
  nlohmann::json own = nlohmann::json::object(), densify = own;
  for (const auto& [name, value] : object.items()) (of_densifier(name) ? densify : own)[name] = value;
  std::vector<std::string> out = set_fields_from_json(static_cast<Config&>(config), own.dump());
  for (std::string& name : field_list::set_from_json(config.densify, densify.dump())) out.push_back(std::move(name));
  return out;
}

VsplatGendenConfig vsplat_genden_config_from_json(const std::string& text, const VsplatGendenConfig& base) {
  VsplatGendenConfig config = base;
  set_fields_from_json(config, text);
  check(config, Status::format);
  return config;
}

std::string field_text(const VsplatGendenConfig& config, const std::string& field) {
  return of_densifier(field) ? field_list::field_text(config.densify, field)
                             : field_text(static_cast<const Config&>(config), field);
}

std::vector<std::string> differing_fields(const VsplatGendenConfig& a, const VsplatGendenConfig& b,
                                          const std::vector<std::string>& fields) {
  std::vector<std::string> own, densify;
  for (const std::string& field : fields) (of_densifier(field) ? densify : own).push_back(field);
  std::vector<std::string> out = differing_fields(static_cast<const Config&>(a), static_cast<const Config&>(b), own);
  for (std::string& name : field_list::differing(a.densify, b.densify, densify)) out.push_back(std::move(name));
  return out;
}

}  // namespace vsplat
