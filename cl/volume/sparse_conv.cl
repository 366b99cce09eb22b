// The weights of a submanifold convolution with its taps in reverse order, as rows of a GEMM: the backward multiplies
// by them.
// ```
// argument    type  shape    what
// w           f32   [N,T,C]  weights: output channel, tap, input channel
// m           f32   [T,N,C]  written: m[k,n,c] = w[n, T-1-k, c]
// work-items  one per element
// ```
kernel void submanifold_backward_mirror(global const float* restrict w, global float* restrict m, int N, int T, int C) {
  const size_t i = get_global_id(0);
  if (i >= (size_t)N * T * C) return;
  const size_t c = i % C, n = i / C % N, k = i / C / N;
  m[i] = w[(n * T + T - 1 - k) * C + c];
}
