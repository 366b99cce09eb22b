// JSON of unknown origin: parsed here, before anything walks what it holds.
#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace vsplat {

// Error(format), which begins with `what`, for text that is no JSON, for values nested deeper than `deepest` (whoever
// walks them does so recursively), and for an object that has a field twice, of which readers would take either.
nlohmann::json parse_json(const std::string& what, const std::string& text, int deepest = 32);

}  // namespace vsplat
