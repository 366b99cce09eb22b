#include "model/networks/params/any_config.h"

#include <nlohmann/json.hpp>

#include "model/base/json_fields.h"
#include "model/networks/params/params.h"
#include "runtime/json_text.h"

namespace vsplat {

using nlohmann::ordered_json;

namespace {

constexpr const char* kSystem = "system";

// Error(usage), since the user gave the name.
template <class Result, class Visit>
Result of_system(const std::string& name, const Visit& visit) {
  try {
    return Systems::of<Result>(name, visit);
  } catch (const Error& e) {
    fail(Status::usage, "{}", e.what());
  }
}

}  // namespace

std::string AnyConfig::system() const {
  return visit([](const auto& c) { return std::string(SystemOf<std::decay_t<decltype(c)>>::name); });
}
std::string AnyConfig::network() const {
  return visit([](const auto& c) { return std::string(SystemOf<std::decay_t<decltype(c)>>::network); });
}
TakenViews AnyConfig::taken() const {
  return visit([](const auto& c) { return c.taken(); });
}
long AnyConfig::selectable() const {
  return visit([](const auto& c) { return c.selectable(); });
}
const char* AnyConfig::selects() const {
  return visit([](const auto& c) { return SystemOf<std::decay_t<decltype(c)>>::selects; });
}
long AnyConfig::noise() const {
  return visit([](const auto& c) { return c.noise(); });
}
bool AnyConfig::has_fine() const {
  return visit([](const auto& c) { return c.has_fine(); });
}
bool AnyConfig::has_surfels() const {
  return visit([](const auto& c) { return c.has_surfels(); });
}

std::vector<Parameter> parameters(const AnyConfig& config) {
  return config.visit([](const auto& c) { return parameters(c); });
}

long parameter_count(const AnyConfig& config) {
  long out = 0;
  for (const Parameter& p : parameters(config)) out += p.trained ? p.count() : 0;
  return out;
}

void check(const AnyConfig& config, Status status) {
  config.visit([status](const auto& c) { check(c, status); });
}

AnyConfig named_any_config(const std::string& system, const std::string& name) {
  return of_system<std::optional<AnyConfig>>(system,
                                             [&](auto s) { return std::optional<AnyConfig>(decltype(s)::named(name)); })
      .value();
}

std::string any_to_json(const AnyConfig& config) {
  const std::string text = config.visit([](const auto& c) { return to_json(c); });
  if (config.get_if<Config>()) return text;
  ordered_json out = {{kSystem, config.system()}};
  out.update(ordered_json::parse(text));
  return out.dump(-1, ' ', true, ordered_json::error_handler_t::replace);
}

AnyConfig any_config_from_json(const std::string& text, const std::string& base) {
  nlohmann::json fields = parse_json("the configuration", text);
  if (!fields.is_object()) fail(Status::format, "the configuration is not a JSON object: {}", json_fields::shown(text));
  std::string system = VsplatSystem::name;
  json_fields::read_present(fields, kSystem, system, "the configuration");
  fields.erase(kSystem);
  return Systems::of<std::optional<AnyConfig>>(
             system,
             [&](auto s) {
               using S = decltype(s);
               return std::optional<AnyConfig>(S::from_json(fields.dump(), S::named(base)));
             })
      .value();
}

AnyConfig with_fields(AnyConfig config, const std::vector<std::string>& assignments) {
  return config.visit([&](auto c) {
    for (const std::string& assignment : assignments) set_field(c, assignment);
    check(c);
    return AnyConfig(c);
  });
}

}  // namespace vsplat
