// Self-contained HTML pages: one file with its data, which loads nothing from elsewhere.
#pragma once
#include <string>

#include "runtime/embedded.h"

namespace vsplat {

// The page with the JSON in place of its @DATA@, and page.css in place of @STYLE@ if it has one. The JSON is escaped so
// that no content can end its HTML element: names and files may come from anyone.
std::string page_with(const EmbeddedFile& page, const std::string& json);

}  // namespace vsplat
