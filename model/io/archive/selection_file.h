// Selected voxels as text: one index (i R + j) R + k per line, i along x, ascending; blank lines and # comments are
// allowed.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

// Error(format) names a line that is no index below `voxels`, out of order or a duplicate.
std::vector<int> read_selection(const std::string& path, long voxels);
void write_selection(const std::string& path, const std::vector<int>& selected);

}  // namespace vsplat
