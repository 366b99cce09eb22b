#include "model/networks/params/weights.h"

#include "runtime/fail.h"

namespace vsplat {

const HostTensor& Weights::at(const std::string& name) const {
  const auto it = tensors_.find(name);
  if (it == tensors_.end()) fail(Status::format, "the model has no tensor {}", name);
  return it->second;
}

const HostTensor& Weights::of(const Parameter& parameter) const {
  const HostTensor& found = at(parameter.name);
  require_shape(parameter, found.shape);
  return found;
}

}  // namespace vsplat
