// Reads configuration fields from JSON by type. A value of another type is refused, never converted.
#pragma once
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "runtime/fail.h"

namespace vsplat::json_fields {

using nlohmann::json;

// Names of the field types in messages.
inline const char* expected_for(int) { return "a whole number"; }
inline const char* expected_for(long) { return "a whole number"; }
inline const char* expected_for(std::uint64_t) { return "a whole number from 0"; }
inline const char* expected_for(double) { return "a number"; }
inline const char* expected_for(bool) { return "true or false"; }
inline const char* expected_for(const std::string&) { return "a string"; }
inline const char* expected_for(const std::vector<int>&) { return "whole numbers"; }
inline const char* expected_for(const std::vector<long>&) { return "a list of whole numbers"; }
inline const char* expected_for(const std::vector<std::string>&) { return "a list of strings"; }

// Refuses values beyond the type's range instead of wrapping them, so that range checks see the original value.
template <class Whole>
bool read_whole(const json& value, Whole& out) {
  if (!value.is_number_integer()) return false;
  if (value.is_number_unsigned() &&
      value.get<std::uint64_t>() > static_cast<std::uint64_t>(std::numeric_limits<Whole>::max()))
    return false;
  if (!value.is_number_unsigned() && value.get<std::int64_t>() < std::numeric_limits<Whole>::min()) return false;
  out = value.get<Whole>();
  return true;
}

inline bool read_field(const json& value, int& out) { return read_whole(value, out); }
inline bool read_field(const json& value, long& out) { return read_whole(value, out); }
inline bool read_field(const json& value, std::uint64_t& out) {
  if (value.is_number_unsigned()) out = value.get<std::uint64_t>();
  return value.is_number_unsigned();
}
inline bool read_field(const json& value, double& out) {
  if (value.is_number()) out = value.get<double>();
  return value.is_number();
}
inline bool read_field(const json& value, bool& out) {
  if (value.is_boolean()) out = value.get<bool>();
  return value.is_boolean();
}
inline bool read_field(const json& value, std::string& out) {
  if (value.is_string()) out = value.get<std::string>();
  return value.is_string();
}
template <class Element>
bool read_field(const json& value, std::vector<Element>& out) {
  if (!value.is_array()) return false;
  out.clear();
  for (const json& element : value)
    if (!read_field(element, out.emplace_back())) return false;
  return true;
}

// Text from a file for a message: ASCII, limited to 100 characters.
inline std::string shown(const json& value) {
  std::string text = value.dump(-1, ' ', true, json::error_handler_t::replace);
  if (text.size() > 100) text = text.substr(0, 100) + "...";
  return text;
}

// Error(format) lists all fields of `object` that are not among `names`; `what` is the object's name in messages.
inline void refuse_unknown(const json& object, const std::vector<std::string>& names, const std::string& what) {
  std::vector<std::string> unknown;
  for (const auto& item : object.items())
    if (std::find(names.begin(), names.end(), item.key()) == names.end()) unknown.push_back(shown(item.key()));
  if (!unknown.empty())
    fail(Status::format, "{} has unknown fields: {}; known are {}", what, fmt::join(unknown, ", "),
         fmt::join(names, ", "));
}

// Reads the field if `object` has it; Error(format) if it has another type.
template <class Value>
void read_present(const json& object, const char* name, Value& value, const std::string& what) {
  const auto found = object.find(name);
  if (found != object.end() && !read_field(*found, value))
    fail(Status::format, "{}'s {} must be {} (found {})", what, name, expected_for(value), shown(*found));
}

}  // namespace vsplat::json_fields
