// Weights from host memory to the device, each checked against the shape that the configuration makes of it.
#pragma once
#include <string>

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

 private:
  const HostTensor& find(const std::string& name, const Shape& shape) const;

  Context& ctx_;
  const Weights& weights_;
  std::string prefix_;
};

}  // namespace vsplat
