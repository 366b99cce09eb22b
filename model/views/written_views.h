// Writes the network's input as a folder that can be read like any other: `--write-views`.
#pragma once
#include <string>
#include <vector>

#include "model/views/views.h"

namespace vsplat {

// The files that write_views() would write: one PNG per view, then cameras.json. The pictures keep their listed stems,
// so that they can be named in the same way; if two views share a stem, all get their index as a prefix.
std::vector<std::string> written_view_files(const std::string& folder, const std::vector<PreparedView>& views);

// Writes pictures rounded to 8 bits, and our cameras.json. Creates the folder if needed. On failure, removes what it
// has written.
void write_views(const std::string& folder, const std::vector<PreparedView>& views);

}  // namespace vsplat
