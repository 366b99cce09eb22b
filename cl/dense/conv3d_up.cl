// Transposed convolution 2x2x2 with stride 2: every voxel of [X, Y, Z] becomes 8, out[2 i + a] = x[i] W[:, :, a] + b.
// The products are one GEMM, whose columns are PyTorch's, 8 corners of each channel side by side (corner (i, j, k) is
// 4 i + 2 j + k); this kernel moves them to their places in out, for n voxels from voxel `first` on.
// ```
// argument    type  shape        what
// parts       f32   [n,Cout,8]   products
// bias        f32   [Cout]       added; null: none
// out         f32   [8 XYZ,Cout] written: the 8 n rows of these voxels
// work-items  (lane, 8 n): the lanes of a row of out share its channels, any number of them
// ```
// The row of out that is corner a of voxel i.
static inline size_t corner_row(int i, int a, int Y, int Z) {
  const int x = i / (Y * Z), y = i / Z % Y, z = i % Z;
  return ((size_t)(2 * x + a / 4) * (2 * Y) + 2 * y + a / 2 % 2) * (2 * Z) + 2 * z + a % 2;
}

kernel void conv3d_up_forward(global const float* restrict parts, global const float* restrict bias,
                              global float* restrict out, int first, int n, int Y, int Z, int Cout) {
  const int i = get_global_id(1) / 8, a = get_global_id(1) % 8;
  if (i >= n) return;
  global const float* from = parts + (size_t)i * Cout * 8 + a;
  global float* to = out + corner_row(first + i, a, Y, Z) * Cout;
  for (int c = get_global_id(0); c < Cout; c += get_local_size(0)) to[c] = from[8 * c] + (bias ? bias[c] : 0.0f);
}

// Backward.
// ```
// argument    type  shape        what
// dy          f32   [8 XYZ,Cout] gradient of out
// dparts      f32   [n,Cout,8]   written
// work-items  as in the forward
// ```
kernel void conv3d_up_backward(global const float* restrict dy, global float* restrict dparts, int first, int n, int Y,
                               int Z, int Cout) {
  const int i = get_global_id(1) / 8, a = get_global_id(1) % 8;
  if (i >= n) return;
  global const float* from = dy + corner_row(first + i, a, Y, Z) * Cout;
  global float* to = dparts + (size_t)i * Cout * 8 + a;
  for (int c = get_global_id(0); c < Cout; c += get_local_size(0)) to[8 * c] = from[c];
}
