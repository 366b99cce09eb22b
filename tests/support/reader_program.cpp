// Test programs have the library's insides in them, and lie elsewhere than the library: they are told where the reader
// is.
#include "model/read/reader.h"

namespace {

[[maybe_unused]] const bool told = [] {
  vsplat::set_reader_program(VSPLAT_READER);
  return true;
}();

}  // namespace
