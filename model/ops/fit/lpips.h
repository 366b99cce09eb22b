// The steps of LPIPS (a distance of pictures by a network's features) other than GEMMs. Pictures are f32 [H, W, C],
// channels last.
#pragma once
#include "runtime/context.h"

namespace vsplat {

// A square window that moves over a picture.
struct Window2d {
  long side = 1, stride = 1, pad = 0;

  // The number of its positions along an edge; 0 if the edge is too short.
  long places(long length) const { return length + 2 * pad < side ? 0 : (length + 2 * pad - side) / stride + 1; }
};

// i32 [places, side side]: the rows (pixels) under the window at each position, -1 outside of the picture. With this
// map a GEMM over a picture's rows is its convolution, with a weight [Cout, side, side, Cin].
Tensor picture_map(Context& ctx, long height, long width, const Window2d& window);

// x = max(x, 0)
void relu(Context& ctx, const Tensor& x);

// The largest value under the window, which has no padding: [places, places, C].
Tensor max_pool(Context& ctx, const Tensor& picture, const Window2d& window);

// At each position of two pictures' features: the weighted squared difference of their unit vectors.
struct FeatureDistance {
  Tensor a, b;    // [.., C]
  Tensor weight;  // [C]
  Tensor out;     // one number per position: a's elements over C
};

void feature_distance(Context& ctx, const FeatureDistance& d);

}  // namespace vsplat
