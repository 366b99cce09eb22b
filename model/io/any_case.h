// Finds files and folders whose names are written in another case than expected.
#pragma once
#include <filesystem>
#include <string>

namespace vsplat {

// Converts ASCII letters only; all other bytes stay unchanged.
std::string lower_case(std::string text);

// `folder`/`name` if it exists; otherwise the only entry of the folder that has this name in another case. Returns
// `folder`/`name` if there is no such entry or more than one, or if the folder is very large.
std::filesystem::path in_any_case(const std::filesystem::path& folder, const std::string& name);

}  // namespace vsplat
