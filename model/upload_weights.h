// Weights from host memory to the device, each checked against the shape that the configuration makes of it.
#pragma once
#include <string>

#include "model/ops/conv3d.h"
#include "model/weights.h"
#include "runtime/gemm.h"

namespace vsplat {

class WeightLoader {
 public:
  // `prefix` is put before every name.
  WeightLoader(Context& ctx, const Weights& weights, std::string prefix);

  // As it is.
  Tensor tensor(const std::string& name, const Shape& shape) const;
  // A Linear's or a 1x1 or patch convolution's weight [N, ...] as the K x N matrix of a GEMM, K the product of the
  // rest.
  PackedMatrix linear(const std::string& name, const Shape& shape) const;
  // Columns [k0, k0 + k) of such a weight's K.
  PackedMatrix linear_part(const std::string& name, const Shape& shape, long k0, long k) const;

  // "<name>.weight" and "<name>.bias" of a 3x3x3 convolution, of a 2x2x2 one with stride 2, and of a submanifold one of
  // kernel^3 taps, whose weight is [out, kernel, kernel, kernel, in].
  ConvWeights conv3d(const std::string& name, long out, long in) const;
  ConvWeights conv3d_down(const std::string& name, long out, long in) const;
  ConvWeights submanifold(const std::string& name, long out, long kernel, long in) const;

 private:
  const HostTensor& find(const std::string& name, const Shape& shape) const;

  Context& ctx_;
  const Weights& weights_;
  std::string prefix_;
};

}  // namespace vsplat
