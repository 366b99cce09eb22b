// Test programs have the library's insides in them, and lie elsewhere than the library: they are told where the reader
// is, and the module that traces rays.
#include "model/data/ray_tracer.h"
#include "model/io/reader/reader.h"

namespace {

[[maybe_unused]] const bool told = [] {
  vsplat::set_reader_program(VSPLAT_READER);
  vsplat::set_rays_module(VSPLAT_RAYS);
  return true;
}();

}  // namespace
