// The optimiser's steps on the device: clipping the norm of all gradients, AdamW (Loshchilov and Hutter 2019), and a
// moving average of weights. Tensors are f32 and of any shape. Nothing here waits for the device, and every run gives
// the same bits.
#pragma once
#include <vector>

#include "runtime/context.h"

namespace vsplat {

// Like torch.nn.utils.clip_grad_norm_: computes the Euclidean norm of all gradients together, and the factor that
// limits it to max_norm. The gradients are not changed; adamw_step() applies the factor. A gradient that is infinite,
// NaN or larger than 1e19 makes the norm infinite or NaN; to find the tensor, call this again with one gradient at a
// time.
struct GradientClip {
  std::vector<Tensor> grads;  // those that are none count as zero
  float scale = 1;            // the true gradients are scale * grads: one over the number of accumulated batches
  float max_norm = 0.5f;
  Tensor out;  // [2]: the norm of scale * grads; the factor, which includes scale
};

void gradient_clip(Context& ctx, const GradientClip& a);

// Like torch.optim.AdamW: decoupled decay, bias-corrected moments.
struct AdamwStep {
  Tensor param, grad, m, v;  // of one shape; grad none: zero, so that moments fade and decay continues
  Tensor clip;               // [2], GradientClip's out; none: the gradient is used unchanged
  long step = 1;             // from 1; m and v start as zeros
  double lr = 4e-4, beta1 = 0.9, beta2 = 0.95, eps = 1e-8, weight_decay = 0.05;
};

void adamw_step(Context& ctx, const AdamwStep& a);

// average = decay * average + (1 - decay) * param
void average_step(Context& ctx, const Tensor& average, const Tensor& param, double decay);

}  // namespace vsplat
