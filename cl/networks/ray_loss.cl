// The mean squared error of predicted rays, and its gradient.
// ```
// argument    type   shape  what
// predicted   f32    [R,6]  rays
// target      f32    [R,6]  targets
// errors      f32    [R]    written: each ray's share of the mean
// dpredicted  f32    [R,6]  written: the gradient times `scale`; null: not written
// work-items  one per ray
// ```
kernel void ray_loss(global const float* predicted, global const float* target, global float* errors,
                     global float* dpredicted, int R, float scale) {
  const int r = get_global_id(0);
  if (r >= R) return;
  const float share = 1.0f / (6.0f * R);
  float sum = 0.0f;
  for (int i = 6 * r; i < 6 * r + 6; ++i) {
    const float off = predicted[i] - target[i];
    sum += off * off;
    if (dpredicted) dpredicted[i] = 2.0f * share * scale * off;
  }
  errors[r] = sum * share;
}
