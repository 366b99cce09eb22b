// Shrinks a picture by a factor k: the mean over k x k pixels, summed by rows, then over them.
// ```
// argument    type  shape          what
// x           f32   [k H, k W, C]
// out         f32   [H, W, C]      written
// work-items  one per value of out
// ```
kernel void area_mean(global const float* restrict x, global float* restrict out, int H, int W, int C, int k) {
  const int i = get_global_id(0);
  if (i >= H * W * C) return;
  const int c = i % C, column = i / C % W, row = i / C / W;
  const long pitch = (long)k * W * C;
  global const float* from = x + (long)row * k * pitch + (long)column * k * C + c;
  float sum = 0.0f;
  for (int y = 0; y < k; ++y) {
    float along = 0.0f;
    for (int j = 0; j < k; ++j) along += from[y * pitch + j * C];
    sum += along;
  }
  out[i] = sum / (float)(k * k);
}
