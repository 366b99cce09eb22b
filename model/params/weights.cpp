#include "model/params/weights.h"

#include "runtime/fail.h"

namespace vsplat {

const HostTensor& Weights::at(const std::string& name) const {
  const auto it = tensors_.find(name);
  if (it == tensors_.end()) fail(Status::format, "the model has no tensor {}", name);
  return it->second;
}

}  // namespace vsplat
