// Positions as sines and cosines: x itself, then sin(2^i x) and cos(2^i x) for i = 0 .. BANDS-1, three values each.
// ```
// argument    type  shape  what
// points      f32   [P,3]  x
// out         f32   [P,W]  columns column .. column + 3 + 6 BANDS - 1 are written; the others stay
// work-items  one per point
// ```
// sin and cos are the accurate ones, since 2^9 x is far outside the first period.
#define BANDS 10

kernel void position_encoding_forward(global const float* restrict points, global float* restrict out, int P, int W,
                                      int column) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const float3 x = vload3(p, points);
  global float* to = out + (long)p * W + column;
  vstore3(x, 0, to);
  for (int i = 0; i < BANDS; ++i) {
    const float3 y = x * (float)(1 << i);
    vstore3(sin(y), 2 * i + 1, to);
    vstore3(cos(y), 2 * i + 2, to);
  }
}

// Backward.
// ```
// argument    type  shape  what
// points      f32   [P,3]  x
// dout        f32   [P,W]  gradient of out, of which the forward's columns are read
// dpoints     f32   [P,3]  added to
// work-items  one per point
// ```
kernel void position_encoding_backward(global const float* restrict points, global const float* restrict dout,
                                       global float* restrict dpoints, int P, int W, int column) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const float3 x = vload3(p, points);
  global const float* from = dout + (long)p * W + column;
  float3 sum = vload3(0, from);
  for (int i = 0; i < BANDS; ++i) {
    const float f = (float)(1 << i);
    const float3 y = x * f;
    sum += f * (cos(y) * vload3(2 * i + 1, from) - sin(y) * vload3(2 * i + 2, from));
  }
  vstore3(vload3(p, dpoints) + sum, p, dpoints);
}
