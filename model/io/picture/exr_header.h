// Checks an EXR header before OpenEXR sees it, because that library allocates memory for whatever size an attribute
// claims.
#pragma once
#include "model/io/picture/image_formats.h"

namespace vsplat {

// Error(format) if an attribute claims more bytes than the rest of the file has, or another size than its type has.
void check_exr_header(const FileBytes& file);

}  // namespace vsplat
