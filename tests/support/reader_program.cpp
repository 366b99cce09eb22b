// Test programs contain the library's code but are not in its folder. This sets the paths of the reader and of the ray
// tracing module.
#include "model/data/ray_tracer.h"
#include "model/io/reader/reader.h"

namespace {

[[maybe_unused]] const bool is_set = [] {
  vsplat::set_reader_program(VSPLAT_READER);
  vsplat::set_rays_module(VSPLAT_RAYS);
  return true;
}();

}  // namespace
