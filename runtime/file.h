// Whole files in and out, with errors that name the path.
#pragma once
#include <cstddef>
#include <string>
#include <vector>

namespace vsplat {

// Throws Error(file) where there is no such file, it is a folder, or it cannot be read.
std::vector<unsigned char> read_file(const std::string& path);

// Writes to a temporary name in the same folder and renames, so that a reader sees the old file or the whole new one; a
// failure (Error(file)) leaves nothing behind. The folder must exist.
void write_file(const std::string& path, const void* data, std::size_t size);

}  // namespace vsplat
