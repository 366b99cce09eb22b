// Steps before and after the matrix products of convolutions' gradients, in both flavours.

// The last step of a 3x3x3 convolution's weight gradient.
// ```
// argument    type  shape            what
// partial     f32   [chunks,27,C,N]  sums over some voxels each, added in order
// dw          f32   [N,C,27]         added to
// work-items  one per element of one chunk's sum
// ```
kernel void conv3d_backward_weights_sum(global const float* restrict partial, global float* restrict dw, int chunks,
                                        int C, int N) {
  const size_t i = get_global_id(0), count = (size_t)27 * C * N;
  if (i >= count) return;
  float sum = 0.0f;
  for (int chunk = 0; chunk < chunks; ++chunk) sum += partial[chunk * count + i];
  const size_t n = i % N, c = i / N % C, t = i / ((size_t)N * C);
  dw[(n * C + c) * 27 + t] += sum;
}

// A 2x2x2 convolution with stride 2 is a GEMM over patches [8,C]. Its weights in the patches' order:
// ```
// argument    type  shape    what
// w           f32   [N,C,8]  weights in PyTorch's layout
// ordered     f32   [N,8,C]  written
// work-items  one per weight
// ```
kernel void conv3d_down_order(global const float* restrict w, global float* restrict ordered, int C, int N) {
  const size_t i = get_global_id(0);
  if (i >= (size_t)8 * C * N) return;
  const size_t c = i % C, t = i / C % 8, n = i / C / 8;
  ordered[i] = w[(n * C + c) * 8 + t];
}

// The reverse, for the weights' gradient:
// ```
// argument    type  shape    what
// dordered    f32   [N,8,C]  gradient in the patches' order
// dw          f32   [N,C,8]  added to
// work-items  one per weight
// ```
kernel void conv3d_down_backward_add(global const float* restrict dordered, global float* restrict dw, int C, int N) {
  const size_t i = get_global_id(0);
  if (i >= (size_t)8 * C * N) return;
  const size_t t = i % 8, c = i / 8 % C, n = i / 8 / C;
  dw[i] += dordered[(n * 8 + t) * C + c];
}
