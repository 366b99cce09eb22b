// Trilinear upsampling of a volume by two along every axis, with sample centres as for align_corners = False.
// Output o lies at (o + 0.5) / 2 - 0.5 of the input: it is 3/4 of input o >> 1 and 1/4 of the neighbour on the side of
// o's parity, which at the border is input o >> 1 itself.
// ```
// argument    type  shape         what
// x           f32   [D,H,W,C]     volume
// y           f32   [2D,2H,2W,C]  written
// work-items  cpu: one per line of the output along its third axis; gpu: (4 channels, output voxel)
// ```

// Interpolates two neighbours along one axis: 3/4 of the near input and 1/4 of the far one.
#define MIX(near, far) ((near)*0.75f + (far)*0.25f)

// The far input of output o along an axis of `size` inputs.
static inline int far_of(int o, int size) { return clamp((o >> 1) + ((o & 1) ? 1 : -1), 0, size - 1); }

// The starts of the input's eight voxels around output (i,j,k), p0 .. p7: near before far along every axis, the third
// axis fastest.
#define CORNERS(i, j, k)                                                                                               \
  const int in = (i) >> 1, jn = (j) >> 1, kn = (k) >> 1, ifar = far_of(i, D), jfar = far_of(j, H),                     \
            kfar = far_of(k, W);                                                                                       \
  global const float *p0 = x + (((long)in * H + jn) * W + kn) * C, *p1 = x + (((long)in * H + jn) * W + kfar) * C;     \
  global const float *p2 = x + (((long)in * H + jfar) * W + kn) * C, *p3 = x + (((long)in * H + jfar) * W + kfar) * C; \
  global const float *p4 = x + (((long)ifar * H + jn) * W + kn) * C, *p5 = x + (((long)ifar * H + jn) * W + kfar) * C; \
  global const float *p6 = x + (((long)ifar * H + jfar) * W + kn) * C,                                                 \
                     *p7 = x + (((long)ifar * H + jfar) * W + kfar) * C;

// Blends the eight voxels at channel c. LOAD determines how many channels at a time.
#define BLEND(LOAD, c)                                                   \
  MIX(MIX(MIX(LOAD(p0, c), LOAD(p1, c)), MIX(LOAD(p2, c), LOAD(p3, c))), \
      MIX(MIX(LOAD(p4, c), LOAD(p5, c)), MIX(LOAD(p6, c), LOAD(p7, c))))

#define LOAD1(p, c) ((p)[c])
#define LOAD4(p, c) vload4(0, (p) + (c))
#define LOAD16(p, c) vload16(0, (p) + (c))

kernel void upsample3d_forward_cpu(global const float* restrict x, global float* restrict y, int D, int H, int W,
                                   int C) {
  const int line = get_global_id(0);
  if (line >= 4 * D * H) return;
  const int i = line / (2 * H), j = line % (2 * H);
  for (int k = 0; k < 2 * W; ++k) {
    CORNERS(i, j, k)
    global float* out = y + ((long)line * 2 * W + k) * C;
    int c = 0;
    for (; c + 16 <= C; c += 16) vstore16(BLEND(LOAD16, c), 0, out + c);
    for (; c < C; ++c) out[c] = BLEND(LOAD1, c);
  }
}

kernel void upsample3d_forward_gpu(global const float* restrict x, global float* restrict y, int D, int H, int W,
                                   int C) {
  const int c = get_global_id(0) * 4, voxel = get_global_id(1);
  if (c >= C || voxel >= 8 * D * H * W) return;
  const int i = voxel / (4 * H * W), j = voxel / (2 * W) % (2 * H), k = voxel % (2 * W);
  CORNERS(i, j, k)
  global float* out = y + (long)voxel * C;
  if (c + 4 <= C) {
    vstore4(BLEND(LOAD4, c), 0, out + c);
  } else {
    for (int rest = c; rest < C; ++rest) out[rest] = BLEND(LOAD1, rest);
  }
}

// Backward. Along an axis, input i is in outputs 2i and 2i + 1 with 3/4 and in outputs 2i - 1 and 2i + 2 with 1/4; at
// the border the latter are outputs 0 and 2 size - 1, which so have both parts of it.
// ```
// argument    type  shape         what
// dy          f32   [2D,2H,2W,C]  gradient of y
// dx          f32   [D,H,W,C]     written, or added to if `add` is not 0
// work-items  cpu: one per line of the input along its third axis; gpu: (channel, input voxel)
// ```
#define TAPS(i, size) \
  { max(2 * (i)-1, 0), 2 * (i), 2 * (i) + 1, min(2 * (i) + 2, 2 * (size)-1) }

// Defines `sum`, of channels from c on: the sum over the 4 x 4 x 4 outputs around input (i,j,k).
#define GATHER(T, LOAD, c, sum)                                                       \
  T sum = (T)(0.0f);                                                                  \
  _Pragma("unroll") for (int a = 0; a < 4; ++a) {                                     \
    T plane = (T)(0.0f);                                                              \
    _Pragma("unroll") for (int b = 0; b < 4; ++b) {                                   \
      global const float* p = dy + ((long)at_x[a] * 2 * H + at_y[b]) * 2 * W * C;     \
      const T far = LOAD(p + (long)at_z[0] * C, c) + LOAD(p + (long)at_z[3] * C, c);  \
      const T near = LOAD(p + (long)at_z[1] * C, c) + LOAD(p + (long)at_z[2] * C, c); \
      plane += MIX(near, far) * (b == 0 || b == 3 ? 0.25f : 0.75f);                   \
    }                                                                                 \
    sum += plane * (a == 0 || a == 3 ? 0.25f : 0.75f);                                \
  }

kernel void upsample3d_backward_cpu(global const float* restrict dy, global float* restrict dx, int add, int D, int H,
                                    int W, int C) {
  const int line = get_global_id(0);
  if (line >= D * H) return;
  const int i = line / H, j = line % H;
  const int at_x[4] = TAPS(i, D), at_y[4] = TAPS(j, H);
  for (int k = 0; k < W; ++k) {
    const int at_z[4] = TAPS(k, W);
    global float* out = dx + ((long)line * W + k) * C;
    int c = 0;
    for (; c + 16 <= C; c += 16) {
      GATHER(float16, LOAD16, c, sum)
      vstore16(add ? sum + vload16(0, out + c) : sum, 0, out + c);
    }
    for (; c < C; ++c) {
      GATHER(float, LOAD1, c, sum)
      out[c] = add ? out[c] + sum : sum;
    }
  }
}

kernel void upsample3d_backward_gpu(global const float* restrict dy, global float* restrict dx, int add, int D, int H,
                                    int W, int C) {
  const int c = get_global_id(0), voxel = get_global_id(1);
  if (c >= C || voxel >= D * H * W) return;
  const int i = voxel / (H * W), j = voxel / W % H, k = voxel % W;
  const int at_x[4] = TAPS(i, D), at_y[4] = TAPS(j, H), at_z[4] = TAPS(k, W);
  GATHER(float, LOAD1, c, sum)
  global float* out = dx + (long)voxel * C + c;
  *out = add ? *out + sum : sum;
}
