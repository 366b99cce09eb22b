// A model's weights in host memory, by their names in the reference's state dict.
#pragma once
#include <map>
#include <string>
#include <vector>

#include "model/networks/params/parameter.h"
#include "runtime/tensor.h"

namespace vsplat {

struct HostTensor {
  Shape shape;
  std::vector<float> data;  // row-major, PyTorch's layout
};

class Weights {
 public:
  // Error(format) names a missing tensor.
  const HostTensor& at(const std::string& name) const;
  // The same for a parameter. Error(format) names both shapes if they differ.
  const HostTensor& of(const Parameter& parameter) const;
  bool has(const std::string& name) const { return tensors_.count(name) != 0; }
  void set(const std::string& name, HostTensor tensor) { tensors_[name] = std::move(tensor); }
  const std::map<std::string, HostTensor>& all() const { return tensors_; }

 private:
  std::map<std::string, HostTensor> tensors_;
};

}  // namespace vsplat
