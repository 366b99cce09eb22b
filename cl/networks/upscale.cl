// Every point becomes F children, which lie within half a cell of it. A child's features are sines and cosines of its
// offset, beside the point's own feature.
static inline float axis(float3 v, int i) { return select(select(v.z, v.y, i == 1), v.x, i == 0); }

// ```
// argument    type  shape      what
// raw         f32   [P,3F]     offset of each child, before tanh
// points      f32   [P,3]      the points
// feature     f32   [P,C]      the points' features
// children    f32   [P F,3]    written: point + offset, offset = reach tanh(raw); a point's children together
// offsets     f32   [P F,3]    written
// wide        f32   [P F,W]    written, W = 6 N + C: sines, then cosines of 2^f unit offset for f = 0 .. N - 1, x y z
//                              each; then the point's feature
// reach       float            half a cell
// unit        float            factor of offsets in the sines and cosines
// work-items  (lane, child): the lanes of a child share its numbers, any number of them
// ```
static inline float wave(float offset, float unit, int f, int is_cosine) {
  const float phase = ldexp(unit * offset, f);
  return is_cosine ? cos(phase) : sin(phase);
}

kernel void upscale_forward(global const float* restrict raw, global const float* restrict points,
                            global const float* restrict feature, global float* restrict children,
                            global float* restrict offsets, global float* restrict wide, int P, int F, int N, int C,
                            float reach, float unit) {
  const int child = get_global_id(1);
  if (child >= P * F) return;
  const int p = child / F, waves = 6 * N, lane = get_global_id(0), lanes = get_local_size(0);
  const float3 offset = reach * tanh(vload3(child, raw));
  if (lane == 0) {
    vstore3(offset, child, offsets);
    vstore3(vload3(p, points) + offset, child, children);
  }
  global float* to = wide + (size_t)child * (waves + C);
  for (int i = lane; i < waves; i += lanes) {
    const int j = i % (3 * N);
    to[i] = wave(axis(offset, j % 3), unit, j / 3, i >= 3 * N);
  }
  for (int c = lane; c < C; c += lanes) to[waves + c] = feature[(size_t)p * C + c];
}

// Backward.
// ```
// argument    type  shape     what
// dchildren   f32   [P F,3]   gradient of children
// dwide       f32   [P F,W]   gradient of wide
// draw        f32   [P,3F]    written
// dpoints     f32   [P,3]     written: the children's sum
// dfeature    f32   [P,C]     added to
// work-items  one per point
// ```
kernel void upscale_backward_points(global const float* restrict raw, global const float* restrict dchildren,
                                    global const float* restrict dwide, global float* restrict draw,
                                    global float* restrict dpoints, int P, int F, int N, int C, float reach,
                                    float unit) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const int waves = 6 * N;
  float3 sum = 0.0f;
  for (int f = 0; f < F; ++f) {
    const size_t child = (size_t)p * F + f;
    const float3 t = tanh(vload3(child, raw)), d = vload3(child, dchildren);
    sum += d;
    float3 by = d;
    global const float* from = dwide + child * (waves + C);
    for (int j = 0; j < 3 * N; ++j) {
      const float slope = ldexp(unit, j / 3);
      const float at = reach * axis(t, j % 3);
      const float more = slope * (from[j] * wave(at, unit, j / 3, 1) - from[3 * N + j] * wave(at, unit, j / 3, 0));
      if (j % 3 == 0)
        by.x += more;
      else if (j % 3 == 1)
        by.y += more;
      else
        by.z += more;
    }
    vstore3(by * reach * (1.0f - t * t), child, draw);
  }
  vstore3(sum, p, dpoints);
}

// ```
// work-items  (lane, point): the lanes of a point share its channels, any number of them
// ```
kernel void upscale_backward_features(global const float* restrict dwide, global float* restrict dfeature, int P, int F,
                                      int N, int C) {
  const int p = get_global_id(1);
  if (p >= P) return;
  const int width = 6 * N + C;
  for (int c = get_global_id(0); c < C; c += get_local_size(0)) {
    float sum = 0.0f;
    for (int f = 0; f < F; ++f) sum += dwide[((size_t)p * F + f) * width + 6 * N + c];
    dfeature[(size_t)p * C + c] += sum;
  }
}
