#include "model/networks/params/built_in_model.h"

#include "runtime/fail.h"
#include "runtime/option.h"

extern "C" {
// Defined in built_in_model.S. The size is stored as data, because a compiler may assume that two objects never have
// the same address.
extern const std::byte vsplat_built_in_model_begin[];
extern const std::uint64_t vsplat_built_in_model_bytes;
}

namespace vsplat {

std::span<const std::byte> built_in_model() {
  return {vsplat_built_in_model_begin, static_cast<std::size_t>(vsplat_built_in_model_bytes)};
}

SafetensorsFile open_built_in_model() {
  if (built_in_model().empty())
    fail(Status::file,
         "no model file is named, and this vsplat was built without a model of its own (model/weights had none): give "
         "one ({}); {} makes one, and {} makes one with random weights",
         Option::model, Option::train, Option::model_init);
  return {"the built-in model", built_in_model()};
}

}  // namespace vsplat
