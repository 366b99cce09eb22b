// Equal letters must mean equal sizes: Dims().bind("x", x, {"R", "C"}).bind("gamma", gamma, {"C"}). An error names the
// tensor.
#pragma once
#include <map>
#include <string>
#include <vector>

#include "runtime/error.h"
#include "runtime/tensor.h"

namespace vsplat {

class Dims {
 public:
  // A label that is a number ("3") must be that size. `type` is checked too.
  Dims& bind(const std::string& name, const Tensor& tensor, const std::vector<std::string>& labels,
             Type type = Type::f32);
  // As bind, but a tensor that is none passes.
  Dims& bind_optional(const std::string& name, const Tensor& tensor, const std::vector<std::string>& labels,
                      Type type = Type::f32);
  // `tensor` has the shape and the type of another, whatever they are.
  Dims& like(const std::string& name, const Tensor& tensor, const std::string& other_name, const Tensor& other);
  Dims& set(const std::string& label, long size);
  long operator[](const std::string& label) const;

 private:
  std::map<std::string, long> sizes_;
};

}  // namespace vsplat
