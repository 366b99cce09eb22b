// The steps of LPIPS (a distance of pictures by a network's features) other than GEMMs: maps that turn the convolutions
// of pictures into GEMMs, ReLU, pooling, distances of features. Pictures are [H,W,C], channels last. A window has side
// x side pixels; [h,w] are its positions, `stride` pixels apart. One work-item per element of the output, in both
// flavours: the cost is negligible beside the GEMMs.

// ```
// argument  type  shape           what
// map       i32   [hw,side side]  written: for each place the rows (y W + x) of the picture under the window; -1
//                                 outside of the picture
// N         int                   elements of map
// pad       int                   pixels by which the first window begins before the picture
// ```
kernel void lpips_map(global int* map, int N, int H, int W, int w, int side, int stride, int pad) {
  const int i = get_global_id(0);
  if (i >= N) return;
  const int place = i / (side * side), tap = i % (side * side);
  const int y = place / w * stride - pad + tap / side, x = place % w * stride - pad + tap % side;
  map[i] = y >= 0 && y < H && x >= 0 && x < W ? y * W + x : -1;
}

// ```
// argument  type  shape  what
// x         f32   [N]    in place: the larger of x and 0
// ```
kernel void lpips_relu(global float* x, int N) {
  const int i = get_global_id(0);
  if (i < N) x[i] = x[i] < 0.0f ? 0.0f : x[i];  // not fmax, which would hide a NaN
}

// ```
// argument  type  shape    what
// in        f32   [H,W,C]  a picture
// out       f32   [h,w,C]  written: the largest value under each window; all windows lie in the picture
// N         int            elements of out
// ```
kernel void lpips_pool(global const float* in, global float* out, int N, int W, int C, int w, int side, int stride) {
  const int i = get_global_id(0);
  if (i >= N) return;
  const int c = i % C, x = i / C % w * stride, y = i / C / w * stride;
  float most = in[(y * W + x) * C + c];
  for (int t = 1; t < side * side; ++t) {
    const float v = in[((y + t / side) * W + x + t % side) * C + c];
    most = v <= most ? most : v;
  }
  out[i] = most;
}

// No fused multiply-add from here on: both products must be rounded alike, so that equal features have distance 0.
#pragma OPENCL FP_CONTRACT OFF

// ```
// argument  type  shape  what
// a, b      f32   [P,C]  features of P places of two pictures
// weight    f32   [C]    of each channel
// out       f32   [P]    written: sum over c of weight[c] (a[c] / |a| - b[c] / |b|)^2, where 1e-10 is added to |a| and
//                        |b|
// ```
kernel void lpips_distance(global const float* a, global const float* b, global const float* weight, global float* out,
                           int P, int C) {
  const int p = get_global_id(0);
  if (p >= P) return;
  a += (size_t)p * C;
  b += (size_t)p * C;
  float aa = 0.0f, bb = 0.0f, sum = 0.0f;
  for (int c = 0; c < C; ++c) {
    aa += a[c] * a[c];
    bb += b[c] * b[c];
  }
  aa = 1.0f / (sqrt(aa) + 1e-10f);
  bb = 1.0f / (sqrt(bb) + 1e-10f);
  for (int c = 0; c < C; ++c) {
    const float d = a[c] * aa - b[c] * bb;
    sum += weight[c] * d * d;
  }
  out[p] = sum;
}
