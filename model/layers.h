// The layers that several stages are made of, by the names of their parameters.
#pragma once
#include <string>

#include "model/ops/conv3d.h"
#include "model/upload_weights.h"
#include "runtime/gemm.h"

namespace vsplat {

// "<name>.weight" [out, in] and "<name>.bias".
struct Linear {
  PackedMatrix w;
  Tensor bias;
};
Linear load_linear(const WeightLoader& weights, const std::string& name, long in, long out);
// Also a 1x1x1 convolution, whose weight is [out, in, 1, 1, 1].
Linear load_pointwise(const WeightLoader& weights, const std::string& name, long in, long out);
Tensor linear(Context& ctx, const Linear& layer, const RowSource& in, const char* name,
              Activation activation = Activation::none);

// "<name>.weight" and "<name>.bias" of a GroupNorm.
struct GroupNorm {
  Tensor gamma, beta;
  int groups = 1;
};
GroupNorm load_group_norm(const WeightLoader& weights, const std::string& name, long channels, int groups);
// SiLU(GroupNorm([x0, x1])), to be made by whoever loads it. Computes the statistics over all rows.
RowSource norm_silu(Context& ctx, const GroupNorm& norm, const Tensor& x0, const Tensor& x1 = {});

// Three linear layers with SiLU between them: "<name>.0", "<name>.2", "<name>.4".
struct Mlp3 {
  Linear first, second, third;
};
Mlp3 load_mlp3(const WeightLoader& weights, const std::string& name, long in, long out);
Tensor mlp3(Context& ctx, const Mlp3& mlp, const Tensor& x, const char* name);

}  // namespace vsplat
