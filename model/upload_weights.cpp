#include "model/upload_weights.h"

#include <fmt/ranges.h>

namespace vsplat {

WeightLoader::WeightLoader(Context& ctx, const Weights& weights, std::string prefix)
    : ctx_(ctx), weights_(weights), prefix_(std::move(prefix)) {}

const HostTensor& WeightLoader::find(const std::string& name, const Shape& shape) const {
  const HostTensor& found = weights_.at(prefix_ + name);
  if (found.shape != shape)
    fail(Status::format, "{}{} is [{}], the configuration makes it [{}]", prefix_, name, fmt::join(found.shape, ", "),
         fmt::join(shape, ", "));
  return found;
}

Tensor WeightLoader::tensor(const std::string& name, const Shape& shape) const {
  return ctx_.upload(shape, find(name, shape).data, Type::f32, prefix_ + name);
}

PackedMatrix WeightLoader::linear(const std::string& name, const Shape& shape) const {
  long k = 1;
  for (std::size_t i = 1; i < shape.size(); ++i) k *= shape[i];
  return linear_part(name, shape, 0, k);
}

PackedMatrix WeightLoader::linear_part(const std::string& name, const Shape& shape, long k0, long k) const {
  long stride = 1;
  for (std::size_t i = 1; i < shape.size(); ++i) stride *= shape[i];
  return pack_matrix(ctx_, find(name, shape).data.data() + k0, k, shape.at(0), 1, stride, prefix_ + name);
}

ConvWeights WeightLoader::conv3d(const std::string& name, long out, long in) const {
  const HostTensor& w = find(name + ".weight", {out, in, 3, 3, 3});
  return pack_conv3d(ctx_, w.data.data(), find(name + ".bias", {out}).data.data(), out, in, prefix_ + name);
}

ConvWeights WeightLoader::conv3d_down(const std::string& name, long out, long in) const {
  const HostTensor& w = find(name + ".weight", {out, in, 2, 2, 2});
  return pack_conv3d_down(ctx_, w.data.data(), find(name + ".bias", {out}).data.data(), out, in, prefix_ + name);
}

ConvWeights WeightLoader::submanifold(const std::string& name, long out, long kernel, long in) const {
  const HostTensor& w = find(name + ".weight", {out, kernel, kernel, kernel, in});
  const long taps = kernel * kernel * kernel;
  return pack_submanifold(ctx_, w.data.data(), find(name + ".bias", {out}).data.data(), out, taps, in, prefix_ + name);
}

}  // namespace vsplat
