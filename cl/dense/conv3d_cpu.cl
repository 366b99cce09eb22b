// 3x3x3 convolution, stride 1, zero padding 1, of a channels-last volume [X,Y,Z,C], cpu flavour. Planes of constant x
// are packed into a ring of R planes (conv3d_forward_pack), so that scratch memory is a few planes whatever X is. Then
// each work-item computes 12 outputs along z times 32 channels (conv3d_forward_cpu); their 14 inputs along z lie side
// by side. The inputs are composed (compose_rows.cl); the padding is zero after that.
#define PACK_ROWS 14
#include "conv3d.clh"
#include "pack_cpu.clh"

// ```
// argument    type  shape                  what
// w           f32   [N,C,27]               weights as PyTorch has them; see conv3d.clh for mirrored
// b           f32   [ceil(N/32),9,C,3,32]  written: panel, (dx, dy), input channel, dz, 32 output channels; zero beyond
//                                          N
// work-items  one per element of b
// ```
kernel void conv3d_pack_weights(global const float* w, int mirrored, int C, int N, global float* b) {
  const size_t i = get_global_id(0);
  const int column = i % TILE_COLS, dz = i / TILE_COLS % 3, c = i / (3 * TILE_COLS) % C;
  const int plane = i / ((size_t)3 * TILE_COLS * C) % 9, panel = i / ((size_t)27 * TILE_COLS * C);
  if (panel >= DIV_UP(N, TILE_COLS)) return;
  b[i] = weight_of(w, mirrored, N, C, panel * TILE_COLS + column, c, plane * 3 + dz);
}

// ```
// argument      type  shape          what
// x0            f32   [X,Y,Z,c0]     first source
// x1            f32   [X,Y,Z,c1]     second source; null: none, c1 = 0
// scale, shift  f32   [c0+c1]        null: neither
// silu          int                  whether SiLU is applied
// R             int                  planes of the ring
// plane0        int                  the first plane that is packed
// ring          f32   [R,Y,ZT,C,14]  written: ZT = ceil(Z/12); entry j of tile zt is z = 12 zt - 1 + j, zero outside
//                                    the volume; plane x of the volume is plane x % R of the ring
// work-items    groups of one: (zt, y, plane from plane0 on)
// ```
kernel void conv3d_forward_pack(global const float* x0, int c0, global const float* x1, int c1,
                                global const float* scale, global const float* shift, int silu, int Y, int Z, int R,
                                int plane0, global float* ring) {
  const int zt = GROUP_ID(0), y = GROUP_ID(1), x = plane0 + GROUP_ID(2);
  const int ZT = DIV_UP(Z, TILE_ROWS);
  int row[PACK_ROWS];
  for (int i = 0; i < PACK_ROWS; ++i) {
    const int z = zt * TILE_ROWS - 1 + i;
    row[i] = z >= 0 && z < Z ? (x * Y + y) * Z + z : -1;
  }
  const size_t tile = ((size_t)(x % R) * Y + y) * ZT + zt;
  pack_sources(x0, c0, x1, c1, row, scale, shift, silu, ring + tile * (c0 + c1) * PACK_ROWS);
}

// ```
// argument    type  shape                  what
// ring        f32   [R,Y,ZT,C,14]          from conv3d_forward_pack: the planes around those that are computed
// b           f32   [ceil(N/32),9,C,3,32]  weights, from conv3d_pack_weights
// plane0      int                          the first plane that is computed
// bias        f32   [N]                    null: none
// residual    f32   [X,Y,Z,N]              null: none; may be out
// out         f32   [X,Y,Z,N]              written: the planes from plane0 on
// work-items  groups of one: (zt + ZT y, plane from plane0 on, panel of b)
// ```
kernel void conv3d_forward_cpu(global const float* ring, global const float* b, int C, int N, int X, int Y, int Z,
                               int R, int plane0, global const float* bias, global const float* residual,
                               global float* out) {
  const int ZT = DIV_UP(Z, TILE_ROWS);
  const int y = GROUP_ID(0) / ZT, zt = GROUP_ID(0) % ZT, x = plane0 + GROUP_ID(1);
  const int n0 = GROUP_ID(2) * TILE_COLS;
  TILE_DECLARE
  // The bounds leave out what lies outside the volume: with `continue` PoCL 7.1 adds wrong taps.
  for (int from_x = max(x - 1, 0); from_x < min(x + 2, X); ++from_x) {
    for (int from_y = max(y - 1, 0); from_y < min(y + 2, Y); ++from_y) {
      const int plane = (from_x - x + 1) * 3 + from_y - y + 1;
      global const float* pa = ring + (((size_t)(from_x % R) * Y + from_y) * ZT + zt) * C * PACK_ROWS;
      global const float* pb = b + ((size_t)n0 * 9 + plane * TILE_COLS) * C * 3;
      for (int c = 0; c < C; ++c) {
        TILE_STEP(pa, pb)
        TILE_STEP(pa + 1, pb + TILE_COLS)
        TILE_STEP(pa + 2, pb + 2 * TILE_COLS)
        pa += PACK_ROWS;
        pb += 3 * TILE_COLS;
      }
    }
  }
  const int z0 = zt * TILE_ROWS;
  const size_t at = ((size_t)(x * Y + y) * Z + z0) * N + n0;
  TILE_FINISH(min(TILE_ROWS, Z - z0), n0, N, bias, 0, residual ? residual + at : residual, out + at);
}

// For the weight gradient: a tensor's rows (one per voxel), composed, as panels of `width` columns.
// ```
// argument    type  shape                         what
// x0 .. silu                                      as in conv3d_forward_pack
// to          f32   [ceil(C/width),voxels,width]  written, C = c0 + c1; zero beyond C
// work-items  one per voxel
// ```
kernel void conv3d_backward_panels(global const float* x0, int c0, global const float* x1, int c1,
                                   global const float* scale, global const float* shift, int silu, int voxels,
                                   int width, global float* to) {
  const int v = get_global_id(0), C = c0 + c1;
  if (v >= voxels) return;
  int at = 0;  // which of the C columns
  for (int part = 0; part < 2; ++part) {
    const int count = part ? c1 : c0, first = part ? c0 : 0;
    for (int c = 0; c < count; c += 16) {
      const int some = min(16, count - c);
      float16 value = load_part((part ? x1 : x0) + (size_t)v * count + c, some);
      if (scale) value = FMA(value, load_part(scale + first + c, some), load_part(shift + first + c, some));
      if (silu) value = silu_16(value);
      float values[16];
      vstore16(value, 0, values);
      for (int j = 0; j < some; ++j, ++at) to[((size_t)(at / width) * voxels + v) * width + at % width] = values[j];
    }
  }
  for (; at < DIV_UP(C, width) * width; ++at) to[((size_t)(at / width) * voxels + v) * width + at % width] = 0.0f;
}

// The weight gradient's sum over one chunk of `lines` lines along z (x slowest), as a product of columns.
// ```
// argument    type  shape                what
// in          f32   [ceil(C/12),XYZ,12]  the convolution's input, from conv3d_backward_panels
// dy          f32   [ceil(N/32),XYZ,32]  gradient of out, from conv3d_backward_panels
// partial     f32   [chunks,27,C,N]      written: the sum over the chunk's voxels p of in[p + tap - 1, c] dy[p, n]
// work-items  groups of one: (tap + 27 panel of in, panel of dy, chunk)
// ```
kernel void conv3d_backward_weights_cpu(global const float* in, global const float* dy, int C, int N, int X, int Y,
                                        int Z, int lines, global float* partial) {
  const int tap = GROUP_ID(0) % 27, c_first = GROUP_ID(0) / 27 * TILE_ROWS;
  const int n0 = GROUP_ID(1) * TILE_COLS, chunk = GROUP_ID(2);
  const int dx = tap / 9 - 1, dy_tap = tap / 3 % 3 - 1, dz = tap % 3 - 1;
  const int from_z = max(0, -dz), until_z = min(Z, Z - dz);
  const size_t voxels = (size_t)X * Y * Z;
  TILE_DECLARE
  for (int line = chunk * lines; line < min((chunk + 1) * lines, X * Y); ++line) {
    const int x = line / Y + dx, y = line % Y + dy_tap;
    if (x < 0 || x >= X || y < 0 || y >= Y) continue;
    global const float* pa = in + (c_first * voxels) + ((size_t)(x * Y + y) * Z + from_z + dz) * TILE_ROWS;
    global const float* pb = dy + (n0 * voxels) + ((size_t)line * Z + from_z) * TILE_COLS;
    for (int z = from_z; z < until_z; ++z) {
      TILE_STEP(pa, pb)
      pa += TILE_ROWS;
      pb += TILE_COLS;
    }
  }
  global const float* none = 0;
  const size_t at = (((size_t)chunk * 27 + tap) * C + c_first) * N + n0;
  TILE_FINISH(min(TILE_ROWS, C - c_first), n0, N, none, 0, none, partial + at);
}
