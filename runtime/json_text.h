// Parses JSON of unknown origin and rejects what is unsafe to walk.
#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace vsplat {

// Throws Error(format), whose message begins with `what`, for invalid JSON, for values nested deeper than `deepest`
// (readers recurse), and for an object with a duplicate field (readers would disagree about its value).
nlohmann::json parse_json(const std::string& what, const std::string& text, int deepest = 32);

}  // namespace vsplat
