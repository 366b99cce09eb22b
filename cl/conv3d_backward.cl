// Around the products of convolutions' gradients, both flavours.

// The end of a 3x3x3 convolution's weight gradient: partial [chunks, 27, C, N], each of some voxels, are added in order,
// and to dw [N, C, 27]. A work-item per element of a partial sum.
kernel void conv3d_backward_weights_sum(global const float* restrict partial, global float* restrict dw, int chunks,
                                        int C, int N) {
  const size_t i = get_global_id(0), count = (size_t)27 * C * N;
  if (i >= count) return;
  float sum = 0.0f;
  for (int chunk = 0; chunk < chunks; ++chunk) sum += partial[chunk * count + i];
  const size_t n = i % N, c = i / N % C, t = i / ((size_t)N * C);
  dw[(n * C + c) * 27 + t] += sum;
}

// A 2x2x2 convolution with stride 2 is a GEMM over patches [8, C], and its weights are w [N, C, 8]. A work-item per weight.
// ordered [N, 8, C]: the weights as the patches have them.
kernel void conv3d_down_order(global const float* restrict w, global float* restrict ordered, int C, int N) {
  const size_t i = get_global_id(0);
  if (i >= (size_t)8 * C * N) return;
  const size_t c = i % C, t = i / C % 8, n = i / C / 8;
  ordered[i] = w[(n * C + c) * 8 + t];
}

// dordered [N, 8, C] is added to dw [N, C, 8].
kernel void conv3d_down_backward_add(global const float* restrict dordered, global float* restrict dw, int C, int N) {
  const size_t i = get_global_id(0);
  if (i >= (size_t)8 * C * N) return;
  const size_t t = i % 8, c = i / 8 % C, n = i / 8 / C;
  dw[i] += dordered[(n * 8 + t) * C + c];
}
