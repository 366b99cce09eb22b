// Functions derived from a configuration's list of fields, for every architecture: names, "FIELD=VALUE", JSON in both
// directions, comparison. A configuration provides each_field(config, visit), which calls visit(name, field) for each
// field in its header's order.
#pragma once
#include <fmt/ranges.h>

#include <charconv>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "model/base/json_fields.h"
#include "runtime/fail.h"
#include "runtime/json_text.h"

namespace vsplat::field_list {

template <class Number>
bool parse_number(const char* begin, const char* end, Number& out) {
  Number value{};
  const auto [stop, problem] = std::from_chars(begin, end, value);
  if (problem != std::errc() || stop != end) return false;
  out = value;
  return true;
}

inline bool parse_field(const std::string& text, int& out) {
  return parse_number(text.data(), text.data() + text.size(), out);
}
inline bool parse_field(const std::string& text, double& out) {
  return parse_number(text.data(), text.data() + text.size(), out);
}
inline bool parse_field(const std::string& text, bool& out) {
  out = text == "true";
  return text == "true" || text == "false";
}
inline bool parse_field(const std::string& text, std::string& out) {
  out = text;
  return true;
}
inline bool parse_field(const std::string& text, std::vector<int>& out) {
  out.clear();
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    int value = 0;
    if (!parse_number(text.data() + at, text.data() + comma, value)) return false;
    out.push_back(value);
    at = comma + 1;
  }
  return true;
}

template <class C>
std::vector<std::string> names() {
  std::vector<std::string> out;
  const C defaults;
  each_field(defaults, [&](const char* name, const auto&) { out.emplace_back(name); });
  return out;
}

template <class C>
void set(C& config, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos) fail(Status::usage, "{}: expected FIELD=VALUE", json_fields::shown(assignment));
  const std::string name = assignment.substr(0, equals), text = assignment.substr(equals + 1);
  bool known = false;
  each_field(config, [&](const char* field, auto& value) {
    if (name != field) return;
    known = true;
    auto parsed = value;
    if (!parse_field(text, parsed))
      fail(Status::usage, "{} must be {} (found {})", name, json_fields::expected_for(value), json_fields::shown(text));
    value = parsed;
  });
  if (!known) fail(Status::usage, "no field {}; there are {}", json_fields::shown(name), fmt::join(names<C>(), ", "));
}

// All fields, in order; callers may remove some.
template <class C>
nlohmann::ordered_json object_of(const C& config) {
  nlohmann::ordered_json out = nlohmann::ordered_json::object();
  each_field(config, [&](const char* name, const auto& value) { out[name] = value; });
  return out;
}
inline std::string text_of(const nlohmann::ordered_json& object) {
  return object.dump(-1, ' ', true, nlohmann::ordered_json::error_handler_t::replace);
}

// Sets the fields that `text` has in `config`. Returns their names. Error(format) for unknown fields and wrong types.
template <class C>
std::vector<std::string> set_from_json(C& config, const std::string& text) {
  const nlohmann::json object = parse_json("the configuration", text);
  if (!object.is_object()) fail(Status::format, "the configuration is not a JSON object: {}", json_fields::shown(text));
  json_fields::refuse_unknown(object, names<C>(), "the configuration");
  std::vector<std::string> found;
  each_field(config, [&](const char* name, auto& value) {
    json_fields::read_present(object, name, value, "the configuration");
    if (object.contains(name)) found.emplace_back(name);
  });
  return found;
}

template <class C>
std::string field_text(const C& config, const std::string& field) {
  std::string out;
  each_field(config, [&](const char* name, const auto& value) {
    if (name == field) out = nlohmann::json(value).dump();
  });
  return out;
}

template <class C>
std::vector<std::string> differing(const C& a, const C& b, const std::vector<std::string>& fields) {
  std::vector<std::string> out;
  for (const std::string& field : fields)
    if (field_text(a, field) != field_text(b, field)) out.push_back(field);
  return out;
}

}  // namespace vsplat::field_list
