// The gradient of a 3x3x3 convolution by its weights, cpu flavour, by Winograd's F(4x4, 3x3) over x and y and directly
// along z (see conv3d_winograd.cl): dg = G^T [sum over tiles of (A dy A^T) . (B^T d B)] G, 36 products where the direct
// sum needs 144. It processes some tiles of the volume at a time; tile t of them is the volume's tile tile0 + t.
// flavour: cpu
#include "tile_cpu.clh"
#include "winograd.clh"

// ```
// argument    type  shape           what
// x           f32   [X,Y,Z,C]       the convolution's input, composed
// v           f32   [36,tiles,Z,C]  written: B^T d B
// work-items  groups of one: (z, tile), Z and `tiles` of them
// ```
kernel void winograd_backward_in(global const float* x, int C, int X, int Y, int Z, int tile0, int tiles,
                                 global float* v) {
  const int z = GROUP_ID(0), t = GROUP_ID(1), TY = DIV_UP(Y, 4);
  const int x0 = 4 * ((tile0 + t) / TY) - 1, y0 = 4 * ((tile0 + t) % TY) - 1;
  const size_t step = (size_t)tiles * Z * C;
  global float* to = v + ((size_t)t * Z + z) * C;
  for (int c = 0; c < C; c += 16) {
    const int width = min(16, C - c);
    float16 d[36];
    for (int i = 0; i < 36; ++i) {
      const int px = x0 + i / 6, py = y0 + i % 6;
      d[i] = px >= 0 && px < X && py >= 0 && py < Y ? load_part(x + ((size_t)(px * Y + py) * Z + z) * C + c, width)
                                                    : (float16)(0.0f);
    }
#pragma unroll
    for (int i = 0; i < 6; ++i) transform_in(d + 6 * i, d + 6 * i, 1);
#pragma unroll
    for (int i = 0; i < 6; ++i) transform_in(d + i, d + i, 6);
    for (int i = 0; i < 36; ++i) store_part(d[i], width, to + i * step + c);
  }
}

// ```
// argument    type  shape            what
// dy          f32   [X,Y,Z,N]        gradient of the convolution's output
// e           f32   [36,tiles,Z,NP]  written: A dy A^T; NP is N rounded up to a multiple of 32, with zeros
// work-items  groups of one: (z, tile), Z and `tiles` of them
// ```
kernel void winograd_backward_out(global const float* dy, int N, int X, int Y, int Z, int tile0, int tiles,
                                  global float* e) {
  const int z = GROUP_ID(0), t = GROUP_ID(1), TY = DIV_UP(Y, 4);
  const int x0 = 4 * ((tile0 + t) / TY), y0 = 4 * ((tile0 + t) % TY), NP = DIV_UP(N, TILE_COLS) * TILE_COLS;
  const size_t step = (size_t)tiles * Z * NP;
  global float* to = e + ((size_t)t * Z + z) * NP;
  for (int n = 0; n < NP; n += 16) {
    const int width = min(16, N - n);
    float16 d[16], half_way[24], all[36];
    for (int i = 0; i < 16; ++i) {
      const int px = x0 + i / 4, py = y0 + i % 4;
      d[i] = px < X && py < Y && width > 0 ? load_part(dy + ((size_t)(px * Y + py) * Z + z) * N + n, width)
                                           : (float16)(0.0f);
    }
#pragma unroll
    for (int i = 0; i < 4; ++i) transform_out_backward(d + i, 4, half_way + i, 4);
#pragma unroll
    for (int i = 0; i < 6; ++i) transform_out_backward(half_way + 4 * i, 1, all + 6 * i, 1);
    for (int i = 0; i < 36; ++i) vstore16(all[i], 0, to + i * step + n);
  }
}

// The sum over these tiles.
// ```
// argument    type  shape            what
// v           f32   [36,tiles,Z,C]   from winograd_backward_in; 12 more numbers lie after it, which are read but not
//                                    used
// e           f32   [36,tiles,Z,NP]  from winograd_backward_out
// add         int                    if not 0, the sums are added to m
// m           f32   [36,3,C,N]       written: the sums; coefficient, dz
// work-items  groups of one: (12 channels, 32 outputs, coefficient)
// ```
kernel void winograd_backward_tile(global const float* v, global const float* e, int C, int N, int Z, int tiles,
                                   int add, global float* m) {
  const int c0 = GROUP_ID(0) * TILE_ROWS, n0 = GROUP_ID(1) * TILE_COLS, i = GROUP_ID(2);
  const int NP = DIV_UP(N, TILE_COLS) * TILE_COLS,
            block = max(1, 64 / Z);  // tiles whose rows stay in the first-level cache for all dz
  global const float* pv = v + (size_t)i * tiles * Z * C + c0;
  global const float* pe = e + (size_t)i * tiles * Z * NP + n0;
  float16 sums[3 * 2 * TILE_ROWS];
  for (int k = 0; k < 3 * 2 * TILE_ROWS; ++k) sums[k] = 0.0f;
  TILE_DECLARE
  for (int t0 = 0; t0 < tiles; t0 += block)
    for (int dz = 0; dz < 3; ++dz) {
      TILE_LOAD(sums + dz * 2 * TILE_ROWS)
      for (int t = t0; t < min(tiles, t0 + block); ++t) {
        const int from = max(0, 1 - dz), until = min(Z, Z + 1 - dz);
        global const float* a = pv + ((size_t)t * Z + from + dz - 1) * C;
        global const float* b = pe + ((size_t)t * Z + from) * NP;
        for (int z = from; z < until; ++z) {
          TILE_STEP(a, b)
          a += C;
          b += NP;
        }
      }
      TILE_STORE(sums + dz * 2 * TILE_ROWS)
    }
  global const float* none = 0;
  for (int dz = 0; dz < 3; ++dz) {
    global float* to = m + ((size_t)(3 * i + dz) * C + c0) * N + n0;
    tile_finish(sums + dz * 2 * TILE_ROWS, min(TILE_ROWS, C - c0), 2, n0, N, none, 0, add ? to : none, to);
  }
}

// ```
// argument    type  shape       what
// m           f32   [36,3,C,N]  the sums over all tiles
// dw          f32   [N,C,27]    added to: G^T m G
// work-items  groups of one: (16 outputs, channel)
// ```
kernel void winograd_backward_sum(global const float* m, int C, int N, global float* dw) {
  const int n0 = GROUP_ID(0) * 16, c = GROUP_ID(1), width = min(16, N - n0);
  float taps[27 * 16];
  for (int dz = 0; dz < 3; ++dz) {
    float16 all[36], half_way[18], g[9];
    for (int i = 0; i < 36; ++i) all[i] = load_part(m + ((size_t)(3 * i + dz) * C + c) * N + n0, width);
#pragma unroll
    for (int i = 0; i < 6; ++i) transform_weights_backward(all + i, 6, half_way + i, 6);
#pragma unroll
    for (int i = 0; i < 3; ++i) transform_weights_backward(half_way + 6 * i, 1, g + 3 * i, 1);
    for (int i = 0; i < 9; ++i) vstore16(g[i], 3 * i + dz, taps);
  }
  for (int j = 0; j < width; ++j)
    for (int t = 0; t < 27; ++t) dw[((size_t)(n0 + j) * C + c) * 27 + t] += taps[16 * t + j];
}
