// EXR's header, walked before OpenEXR sees it: that library takes memory for what an attribute claims to hold.
#pragma once
#include "model/io/picture/image_formats.h"

namespace vsplat {

// Error(format) where an attribute is longer than what follows of the file, or than its type is.
void check_exr_header(const FileBytes& file);

}  // namespace vsplat
