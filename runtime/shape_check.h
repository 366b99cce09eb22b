// Checks shapes: equal letters must be equal sizes, as in Dims().bind("x", x, {"R", "C"}).bind("gamma", gamma, {"C"}).
// An error names the tensor.
#pragma once
#include <map>
#include <string>
#include <vector>

#include "runtime/error.h"
#include "runtime/tensor.h"

namespace vsplat {

class Dims {
 public:
  // A label that is a number ("3") requires that size. Checks `type`, too.
  Dims& bind(const std::string& name, const Tensor& tensor, const std::vector<std::string>& labels,
             Type type = Type::f32);
  // Like bind, but accepts an empty tensor.
  Dims& bind_optional(const std::string& name, const Tensor& tensor, const std::vector<std::string>& labels,
                      Type type = Type::f32);
  // Requires the shape and the type of `other`.
  Dims& like(const std::string& name, const Tensor& tensor, const std::string& other_name, const Tensor& other);
  Dims& set(const std::string& label, long size);
  long operator[](const std::string& label) const;

 private:
  std::map<std::string, long> sizes_;
};

}  // namespace vsplat
