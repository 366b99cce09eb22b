// A model's weights in host memory, by the names of the reference's state dict.
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
  // Throws Error(format) that names what is missing.
  const HostTensor& at(const std::string& name) const;
  // The same of a parameter, whose shape it must have: Error(format) that names both, where it has not.
  const HostTensor& of(const Parameter& parameter) const;
  bool has(const std::string& name) const { return tensors_.count(name) != 0; }
  void set(const std::string& name, HostTensor tensor) { tensors_[name] = std::move(tensor); }
  const std::map<std::string, HostTensor>& all() const { return tensors_; }

 private:
  std::map<std::string, HostTensor> tensors_;
};

}  // namespace vsplat
