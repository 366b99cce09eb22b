// HDF5's files: those that the library opens, read and nothing else.
#pragma once
#include <hdf5.h>

#include "model/io/reader/program/library.h"

namespace vsplat::read {

// Makes a list of access properties (H5P_FILE_ACCESS) take files from `library`, which must outlive their use; so do
// the files that links lead to.
void take_files_from(Library& library, hid_t access);

}  // namespace vsplat::read
