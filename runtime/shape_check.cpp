#include "runtime/shape_check.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cctype>

#include "runtime/fail.h"

namespace vsplat {

Dims& Dims::bind(const std::string& name, const Tensor& tensor, const std::vector<std::string>& labels, Type type) {
  if (!tensor) fail(Status::internal, "{}: none given, [{}] expected", name, fmt::join(labels, ", "));
  if (tensor.type() != type)
    fail(Status::internal, "{}: {} found, {} expected", name, tensor.describe(), name_of(type));
  if (tensor.rank() != labels.size())
    fail(Status::internal, "{}: {} found, [{}] expected", name, tensor.describe(), fmt::join(labels, ", "));
  for (std::size_t i = 0; i < labels.size(); ++i) {
    const std::string& label = labels[i];
    const long size = tensor.dim(i);
    const long expected = std::isdigit(static_cast<unsigned char>(label[0])) ? std::stol(label)
                          : sizes_.count(label)                              ? sizes_.at(label)
                                                                             : size;
    if (size != expected)
      fail(Status::internal, "{}: {} found, but {} is {} (expected [{}])", name, tensor.describe(), label, expected,
           fmt::join(labels, ", "));
    sizes_.emplace(label, size);
  }
  return *this;
}

Dims& Dims::bind_optional(const std::string& name, const Tensor& tensor, const std::vector<std::string>& labels,
                          Type type) {
  return tensor ? bind(name, tensor, labels, type) : *this;
}

Dims& Dims::like(const std::string& name, const Tensor& tensor, const std::string& other_name, const Tensor& other) {
  if (!tensor || tensor.type() != other.type() || tensor.shape() != other.shape())
    fail(Status::internal, "{}: {} found, {} is {}", name, tensor.describe(), other_name, other.describe());
  return *this;
}

Dims& Dims::set(const std::string& label, long size) {
  const auto [it, fresh] = sizes_.emplace(label, size);
  if (!fresh && it->second != size) fail(Status::internal, "{} is {}, {} expected", label, size, it->second);
  return *this;
}

long Dims::operator[](const std::string& label) const {
  const auto it = sizes_.find(label);
  if (it == sizes_.end()) fail(Status::internal, "no size is bound to {}", label);
  return it->second;
}

}  // namespace vsplat
