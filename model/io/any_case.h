// Files and folders whose names are written in another case than expected.
#pragma once
#include <filesystem>
#include <string>

namespace vsplat {

// ASCII letters alone: the bytes of others stay as they are.
std::string lower_case(std::string text);

// `folder`/`name` where that is there; else the one entry of the folder that has this name in another case. Where there
// is none, or more than one, or the folder is very large, `folder`/`name`.
std::filesystem::path in_any_case(const std::filesystem::path& folder, const std::string& name);

}  // namespace vsplat
