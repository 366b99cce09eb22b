// The optimiser's steps on the device: clipping the norm of all gradients, AdamW (Loshchilov and Hutter 2019), and a
// moving average of weights. Tensors are f32 and of any shape. Nothing here waits for the device, and every run gives
// the same bits.
#pragma once
#include <vector>

#include "runtime/context.h"

namespace vsplat {

// As torch.nn.utils.clip_grad_norm_: the Euclidean norm of all gradients taken together, and what to multiply them by
// so that it is at most max_norm. The gradients stay as they are; adamw_step() takes the factor. A gradient that is
// infinite or no number, or larger than 1e19, makes the norm infinite or NaN: whoever reads it and wants to know which
// tensor it was asks again with one gradient at a time.
struct GradientClip {
  std::vector<Tensor> grads;  // those that are none count as zero
  float scale = 1;            // the gradients proper are scale * grads: one over the number of accumulated batches
  float max_norm = 0.5f;
  Tensor out;  // [2]: the norm of scale * grads; the factor, which has scale in it
};

void gradient_clip(Context& ctx, const GradientClip& a);

// As torch.optim.AdamW: decoupled decay, bias-corrected moments.
struct AdamwStep {
  Tensor param, grad, m, v;  // of one shape; no grad: zero, so that moments fade and decay goes on
  Tensor clip;               // [2], GradientClip's out; none: the gradient as it is
  long step = 1;             // from 1; m and v start as zeros
  double lr = 4e-4, beta1 = 0.9, beta2 = 0.95, eps = 1e-8, weight_decay = 0.05;
};

void adamw_step(Context& ctx, const AdamwStep& a);

// average = decay * average + (1 - decay) * param
void average_step(Context& ctx, const Tensor& average, const Tensor& param, double decay);

}  // namespace vsplat
