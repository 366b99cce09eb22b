#include "model/network/upload_weights.h"

#include <fmt/ranges.h>

#include "model/ops/sparse_conv.h"
#include "runtime/fail.h"

namespace vsplat {

WeightLoader::WeightLoader(Context& ctx, const WeightSource& weights, std::string prefix)
    : ctx_(ctx), weights_(weights), prefix_(std::move(prefix)) {}

void WeightLoader::check_shape(const std::string& name, const Shape& found, const Shape& expected) const {
  if (found != expected)
    fail(Status::format, "{}{} is [{}], the configuration makes it [{}]", prefix_, name, fmt::join(found, ", "),
         fmt::join(expected, ", "));
}

const HostTensor& WeightLoader::find(const std::string& name, const Shape& shape) const {
  const HostTensor& found = weights_.host_->at(prefix_ + name);
  check_shape(name, found.shape, shape);
  return found;
}

const LearntTensor& WeightLoader::find_learnt(const std::string& name, const Shape& shape) const {
  const LearntTensor& found = weights_.learnt_->at(prefix_ + name);
  check_shape(name, found.value.shape(), shape);
  return found;
}

Tensor WeightLoader::tensor(const std::string& name, const Shape& shape) const {
  if (weights_.learnt_) return find_learnt(name, shape).value;
  return ctx_.upload(shape, find(name, shape).data, Type::f32, prefix_ + name);
}

Tensor WeightLoader::gradient(const std::string& name) const {
  return weights_.learnt_ ? weights_.learnt_->at(prefix_ + name).gradient : Tensor();
}

Tensor WeightLoader::plain(const std::string& name) const {
  return weights_.learnt_ ? weights_.learnt_->at(prefix_ + name).value : Tensor();
}

PackedMatrix WeightLoader::linear(const std::string& name, const Shape& shape) const {
  long k = 1;
  for (std::size_t i = 1; i < shape.size(); ++i) k *= shape[i];
  return linear_part(name, shape, 0, k);
}

PackedMatrix WeightLoader::linear_part(const std::string& name, const Shape& shape, long k0, long k) const {
  long stride = 1;
  for (std::size_t i = 1; i < shape.size(); ++i) stride *= shape[i];
  if (weights_.learnt_)
    return pack_matrix(ctx_, find_learnt(name, shape).value, k, shape.at(0), 1, stride, prefix_ + name, k0);
  return pack_matrix(ctx_, find(name, shape).data.data() + k0, k, shape.at(0), 1, stride, prefix_ + name);
}

Conv WeightLoader::learnt_conv(const std::string& name) const {
  Conv out;
  out.plain = plain(name + ".weight");
  out.dweight = gradient(name + ".weight");
  out.dbias = gradient(name + ".bias");
  return out;
}

Conv WeightLoader::conv3d(const std::string& name, long out, long in) const {
  const Shape shape{out, in, 3, 3, 3};
  Conv conv = learnt_conv(name);
  if (weights_.learnt_) {
    conv.w =
        pack_conv3d(ctx_, find_learnt(name + ".weight", shape).value, tensor(name + ".bias", {out}), prefix_ + name);
  } else {
    conv.w = pack_conv3d(ctx_, find(name + ".weight", shape).data.data(), find(name + ".bias", {out}).data.data(), out,
                         in, prefix_ + name);
  }
  return conv;
}

Conv WeightLoader::conv3d_down(const std::string& name, long out, long in) const {
  const Shape shape{out, in, 2, 2, 2};
  Conv conv = learnt_conv(name);
  if (weights_.learnt_) {
    conv.w = pack_conv3d_down(ctx_, find_learnt(name + ".weight", shape).value, tensor(name + ".bias", {out}),
                              prefix_ + name);
  } else {
    conv.w = pack_conv3d_down(ctx_, find(name + ".weight", shape).data.data(), find(name + ".bias", {out}).data.data(),
                              out, in, prefix_ + name);
  }
  return conv;
}

Conv WeightLoader::submanifold(const std::string& name, long out, long kernel, long in) const {
  const Shape shape{out, kernel, kernel, kernel, in};
  Conv conv = learnt_conv(name);
  if (weights_.learnt_) {
    conv.w = pack_submanifold(ctx_, find_learnt(name + ".weight", shape).value, tensor(name + ".bias", {out}),
                              prefix_ + name);
  } else {
    conv.w = pack_submanifold(ctx_, find(name + ".weight", shape).data.data(), find(name + ".bias", {out}).data.data(),
                              out, kernel * kernel * kernel, in, prefix_ + name);
  }
  return conv;
}

}  // namespace vsplat
