// Weights as the stages' constructors take them, each checked against the shape that the configuration makes of it.
#pragma once
#include <string>

#include "model/network/learnt_weights.h"
#include "model/ops/conv3d.h"
#include "model/params/weights.h"
#include "runtime/gemm.h"

namespace vsplat {

// Where a stage finds its weights: in host memory, to be uploaded for inference, or on the device, where training
// changes them and wants gradients. Refers to what it was made from.
class WeightSource {
 public:
  WeightSource(const Weights& host) : host_(&host) {}              // NOLINT(google-explicit-constructor)
  WeightSource(const LearntWeights& learnt) : learnt_(&learnt) {}  // NOLINT(google-explicit-constructor)

 private:
  friend class WeightLoader;
  const Weights* host_ = nullptr;
  const LearntWeights* learnt_ = nullptr;
};

// A convolution's weights. In training: as PyTorch has them, and the gradients by them and the bias.
struct Conv {
  ConvWeights w;
  Tensor plain, dweight, dbias;
};

class WeightLoader {
 public:
  // `prefix` is put before every name.
  WeightLoader(Context& ctx, const WeightSource& weights, std::string prefix);

  // As it is.
  Tensor tensor(const std::string& name, const Shape& shape) const;
  // In training the gradient by such a tensor, which is added to; else none.
  Tensor gradient(const std::string& name) const;
  // In training the tensor itself, for what only the backward wants; else none.
  Tensor plain(const std::string& name) const;
  // A Linear's or a 1x1 or patch convolution's weight [N, ...] as the K x N matrix of a GEMM, K the product of the
  // rest.
  PackedMatrix linear(const std::string& name, const Shape& shape) const;
  // Columns [k0, k0 + k) of such a weight's K.
  PackedMatrix linear_part(const std::string& name, const Shape& shape, long k0, long k) const;

  // "<name>.weight" and "<name>.bias" of a 3x3x3 convolution, of a 2x2x2 one with stride 2, and of a submanifold one of
  // kernel^3 taps, whose weight is [out, kernel, kernel, kernel, in].
  Conv conv3d(const std::string& name, long out, long in) const;
  Conv conv3d_down(const std::string& name, long out, long in) const;
  Conv submanifold(const std::string& name, long out, long kernel, long in) const;

 private:
  const HostTensor& find(const std::string& name, const Shape& shape) const;
  const LearntTensor& find_learnt(const std::string& name, const Shape& shape) const;
  void check_shape(const std::string& name, const Shape& found, const Shape& expected) const;
  Conv learnt_conv(const std::string& name) const;

  Context& ctx_;
  WeightSource weights_;
  std::string prefix_;
};

}  // namespace vsplat
