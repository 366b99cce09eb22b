// Pages that carry their data: one file, which needs nothing from elsewhere.
#pragma once
#include <string>

#include "runtime/embedded.h"

namespace vsplat {

// The page with that JSON in the place of its @DATA@, as text that ends no element of it, whatever is in it: names and
// files may be anyone's.
std::string page_with(const EmbeddedFile& page, const std::string& json);

}  // namespace vsplat
