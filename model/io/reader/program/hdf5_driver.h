// An HDF5 file driver for files that the library opens; read-only.
#pragma once
#include <hdf5.h>

#include "model/io/reader/program/library.h"

namespace vsplat::read {

// Makes a file access property list (H5P_FILE_ACCESS) open its files, and those that links refer to, through `library`,
// which must outlive their use.
void take_files_from(Library& library, hid_t access);

}  // namespace vsplat::read
