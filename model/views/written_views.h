// What the network gets, as a folder that can be read like any other: `--write-views`.
#pragma once
#include <string>
#include <vector>

#include "model/views/views.h"

namespace vsplat {

// The files write_views() would write: one PNG per view, then cameras.json. The pictures keep the stems they were
// listed under, so that they can be named in the same way; where two views share one, all get their index before it.
std::vector<std::string> written_view_files(const std::string& folder, const std::vector<PreparedView>& views);

// Pictures rounded to 8 bits, and our cameras.json. Makes the folder where there is none; a failure takes away again
// what it has written.
void write_views(const std::string& folder, const std::vector<PreparedView>& views);

}  // namespace vsplat
