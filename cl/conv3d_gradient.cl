// The end of a 3x3x3 convolution's weight gradient, both flavours: partial [chunks, 27, C, N], each of some voxels, are added in order,
// and to dw [N, C, 27]. A work-item per element of a partial sum.
__kernel void conv3d_weight_sum(__global const float* restrict partial, __global float* restrict dw, int chunks, int C, int N) {
  const size_t i = get_global_id(0), count = (size_t)27 * C * N;
  if (i >= count) return;
  float sum = 0.0f;
  for (int chunk = 0; chunk < chunks; ++chunk) sum += partial[chunk * count + i];
  const size_t n = i % N, c = i / N % C, t = i / ((size_t)N * C);
  dw[(n * C + c) * 27 + t] += sum;
}
