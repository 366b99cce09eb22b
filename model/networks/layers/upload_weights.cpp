#include "model/networks/layers/upload_weights.h"

#include "model/ops/dense/conv3d_up.h"
#include "model/ops/dense/layer_scale.h"
#include "model/ops/dense/position_resample.h"
#include "model/ops/volume/sparse_conv.h"

namespace vsplat {
namespace {

// A weight [N, ...] as a matrix [N, K]; the tensor may be empty.
Tensor as_matrix(const Tensor& weight) {
  return weight ? weight.reshaped({weight.dim(0), weight.count() / weight.dim(0)}) : weight;
}

}  // namespace

const std::vector<float>& WeightLoader::host(const Parameter& p) const { return weights_.host_->of(p).data; }

const LearntTensor& WeightLoader::on_device(const Parameter& p) const {
  const LearntTensor& found = weights_.learnt_->at(p.name);
  require_shape(p, found.value.shape());
  return found;
}

Tensor WeightLoader::value(const Parameter& p) const {
  if (p.name.empty()) return {};
  return weights_.learnt_ ? on_device(p).value : ctx_->upload(p.shape, host(p), Type::f32, p.name);
}

Tensor WeightLoader::plain(const Parameter& p) const { return weights_.learnt_ ? on_device(p).value : Tensor(); }

Tensor WeightLoader::gradient(const Parameter& p) const {
  return weights_.learnt_ && !p.name.empty() ? on_device(p).gradient : Tensor();
}

PackedMatrix WeightLoader::columns(const Parameter& p, long k0, long k) const {
  const long n = p.shape.at(0), stride = p.count() / n;
  if (weights_.learnt_) return pack_matrix(*ctx_, on_device(p).value, k, n, 1, stride, p.name, k0);
  return pack_matrix(*ctx_, host(p).data() + k0, k, n, 1, stride, p.name);
}

Positions WeightLoader::positions(const Parameter& class_token, const Parameter& stored, int from, int to) const {
  const long rows = stored.shape.at(1), dim = stored.shape.at(2);
  Positions out;
  out.from = from;
  out.to = to;
  out.resampled = ctx_->tensor({1 + static_cast<long>(to) * to, dim}, Type::f32, "encoder.position");
  position_resample_forward(
      *ctx_, {value(stored).reshaped({rows, dim}), value(class_token).reshaped({dim}), from, to, out.resampled});
  if (const Tensor d = gradient(stored)) out.dstored = d.reshaped({rows, dim});
  if (const Tensor d = gradient(class_token)) out.dclass_token = d.reshaped({dim});
  return out;
}

Linear WeightLoader::linear(const LayerParameters& p) const {
  return {columns(p.weight, 0, p.weight.count() / p.weight.shape.at(0)), value(p.bias), as_matrix(plain(p.weight)),
          as_matrix(gradient(p.weight)), gradient(p.bias)};
}

ScaledLinear WeightLoader::scaled_linear(const LayerParameters& p, const Learnt* scale) const {
  ScaledLinear out;
  if (scale == nullptr) {
    out.folded = linear(p);
    return out;
  }
  const long n = p.weight.shape.at(0), k = p.weight.count() / n;
  out.scale = scale->value;
  const Tensor weight = as_matrix(value(p.weight)), bias = value(p.bias);
  const Tensor folded = ctx_->tensor({n, k}, Type::f32, p.name);
  out.folded.bias = ctx_->tensor({n}, Type::f32, p.name);
  layer_scale_forward(*ctx_, {weight, bias, out.scale, folded, out.folded.bias});
  out.folded.w = pack_matrix(*ctx_, folded, k, n, 1, k, p.name);
  if (!weights_.learnt_) return out;
  out.folded.plain = folded;
  out.weight = weight, out.bias = bias;
  out.dweight = as_matrix(gradient(p.weight)), out.dbias = gradient(p.bias), out.dscale = scale->gradient;
  return out;
}

SplitLinear WeightLoader::split_linear(const LayerParameters& p, long first) const {
  const long all = p.weight.count() / p.weight.shape.at(0);
  return {columns(p.weight, 0, first), columns(p.weight, first, all - first), value(p.bias),
          as_matrix(plain(p.weight)),  as_matrix(gradient(p.weight)),         gradient(p.bias)};
}

Conv WeightLoader::conv(const LayerParameters& p, ConvWeights weights) const {
  return {std::move(weights), plain(p.weight), gradient(p.weight), gradient(p.bias)};
}

Conv WeightLoader::conv3d(const LayerParameters& p) const {
  if (weights_.learnt_) return conv(p, pack_conv3d(*ctx_, on_device(p.weight).value, value(p.bias), p.name));
  const long out = p.weight.shape.at(0), in = p.weight.shape.at(1);
  const float* bias = p.bias.name.empty() ? nullptr : host(p.bias).data();
  return conv(p, pack_conv3d(*ctx_, host(p.weight).data(), bias, out, in, p.name));
}

Conv WeightLoader::conv3d_down(const LayerParameters& p) const {
  if (weights_.learnt_) return conv(p, pack_conv3d_down(*ctx_, on_device(p.weight).value, value(p.bias), p.name));
  const long out = p.weight.shape.at(0), in = p.weight.shape.at(1);
  return conv(p, pack_conv3d_down(*ctx_, host(p.weight).data(), host(p.bias).data(), out, in, p.name));
}

ConvUp WeightLoader::conv3d_up(const LayerParameters& p) const {
  const long in = p.weight.shape.at(0), out = p.weight.shape.at(1);
  PackedMatrix w = weights_.learnt_ ? pack_conv3d_up(*ctx_, on_device(p.weight).value, p.name)
                                    : pack_conv3d_up(*ctx_, host(p.weight).data(), in, out, p.name);
  return {std::move(w), value(p.bias), plain(p.weight), gradient(p.weight), gradient(p.bias)};
}

Conv WeightLoader::submanifold(const LayerParameters& p) const {
  const long out = p.weight.shape.at(0), in = p.weight.shape.at(4), taps = p.weight.count() / (out * in);
  if (weights_.learnt_) return conv(p, pack_submanifold(*ctx_, on_device(p.weight).value, value(p.bias), p.name));
  return conv(p, pack_submanifold(*ctx_, host(p.weight).data(), host(p.bias).data(), out, taps, in, p.name));
}

LayerNorm WeightLoader::layer_norm(const LayerParameters& p) const {
  return {value(p.weight), value(p.bias), gradient(p.weight), gradient(p.bias)};
}

GroupNorm WeightLoader::group_norm(const LayerParameters& p, int groups) const {
  return {value(p.weight), value(p.bias), groups, gradient(p.weight), gradient(p.bias)};
}

}  // namespace vsplat
