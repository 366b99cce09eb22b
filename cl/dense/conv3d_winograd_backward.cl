// The gradient of a 3x3x3 convolution by its weights, cpu flavour, by Winograd's F(4x4, 3x3) over x and y and directly
// along z (see conv3d_winograd.cl): dg = G^T [sum over tiles of (A dy A^T) . (B^T d B)] G, 36 products where the direct
// sum needs 144. It processes some tiles of the volume at a time; tile t of them is the volume's tile tile0 + t.
// flavour: cpu
#include "term_tile_cpu.clh"
#include "winograd.clh"

// With PAIRS, a word of v and e holds the same number of two neighbouring tiles (pairs_cpu.clh): of tiles 2 t and
// 2 t + 1, or of the last one and 0. [tiles] stands for the number of tiles in terms.
#define IN_TERM (2 / TERMS_OF(2))  // tiles of a term

// Joins two neighbouring tiles' numbers [36], as bits of words.
#ifdef PAIRS
static inline void join_tiles(float16* first, const float16* second) {
  for (int i = 0; i < 36; ++i) first[i] = as_float16(pairs_of(first[i], second[i]));
}
#endif

// B^T d B of a tile: d [36], at position z and channels c .. c + 15, of which `width` exist; zeros if not `exists`.
static inline void tile_in(global const float* x, int C, int X, int Y, int Z, int tile, int exists, int z, int c,
                           int width, float16* d) {
  const int TY = DIV_UP(Y, 4), x0 = 4 * (tile / TY) - 1, y0 = 4 * (tile % TY) - 1;
  for (int i = 0; i < 36; ++i) {
    const int px = x0 + i / 6, py = y0 + i % 6;
    d[i] = exists && px >= 0 && px < X && py >= 0 && py < Y
               ? load_part(x + ((size_t)(px * Y + py) * Z + z) * C + c, width)
               : (float16)(0.0f);
  }
#pragma unroll
  for (int i = 0; i < 6; ++i) transform_in(d + 6 * i, d + 6 * i, 1);
#pragma unroll
  for (int i = 0; i < 6; ++i) transform_in(d + i, d + i, 6);
}

// A dy A^T of a tile: e [36], at position z and outputs n .. n + 15, of which `width` exist; zeros if not `exists`.
static inline void tile_out(global const float* dy, int N, int X, int Y, int Z, int tile, int exists, int z, int n,
                            int width, float16* e) {
  const int TY = DIV_UP(Y, 4), x0 = 4 * (tile / TY), y0 = 4 * (tile % TY);
  float16 d[16], half_way[24];
  for (int i = 0; i < 16; ++i) {
    const int px = x0 + i / 4, py = y0 + i % 4;
    d[i] = exists && px < X && py < Y && width > 0 ? load_part(dy + ((size_t)(px * Y + py) * Z + z) * N + n, width)
                                                   : (float16)(0.0f);
  }
#pragma unroll
  for (int i = 0; i < 4; ++i) transform_out_backward(d + i, 4, half_way + i, 4);
#pragma unroll
  for (int i = 0; i < 6; ++i) transform_out_backward(half_way + 4 * i, 1, e + 6 * i, 1);
}

// ```
// argument    type  shape           what
// x           f32   [X,Y,Z,C]       the convolution's input, composed
// v           f32   [36,tiles,Z,C]  written: B^T d B; with PAIRS u32
// work-items  groups of one: (z, tile in terms), Z and [tiles] of them
// ```
kernel void winograd_backward_in(global const float* x, int C, int X, int Y, int Z, int tile0, int tiles,
                                 global Term* v) {
  const int z = GROUP_ID(0), t = GROUP_ID(1) * IN_TERM;
  const size_t step = (size_t)TERMS_OF(tiles) * Z * C;
  global float* to = (global float*)v + ((size_t)GROUP_ID(1) * Z + z) * C;
  for (int c = 0; c < C; c += 16) {
    const int width = min(16, C - c);
    float16 d[36];
    tile_in(x, C, X, Y, Z, tile0 + t, 1, z, c, width, d);
#ifdef PAIRS
    float16 second[36];
    tile_in(x, C, X, Y, Z, tile0 + t + 1, t + 1 < tiles, z, c, width, second);
    join_tiles(d, second);
#endif
    for (int i = 0; i < 36; ++i) store_part(d[i], width, to + i * step + c);
  }
}

// ```
// argument    type  shape            what
// dy          f32   [X,Y,Z,N]        gradient of the convolution's output
// e           f32   [36,tiles,Z,NP]  written: A dy A^T; NP is N rounded up to a multiple of 32, with zeros; with PAIRS
//                                    u32
// work-items  groups of one: (z, tile in terms), Z and [tiles] of them
// ```
kernel void winograd_backward_out(global const float* dy, int N, int X, int Y, int Z, int tile0, int tiles,
                                  global Term* e) {
  const int z = GROUP_ID(0), t = GROUP_ID(1) * IN_TERM, NP = DIV_UP(N, TILE_COLS) * TILE_COLS;
  const size_t step = (size_t)TERMS_OF(tiles) * Z * NP;
  global float* to = (global float*)e + ((size_t)GROUP_ID(1) * Z + z) * NP;
  for (int n = 0; n < NP; n += 16) {
    const int width = min(16, N - n);
    float16 all[36];
    tile_out(dy, N, X, Y, Z, tile0 + t, 1, z, n, width, all);
#ifdef PAIRS
    float16 second[36];
    tile_out(dy, N, X, Y, Z, tile0 + t + 1, t + 1 < tiles, z, n, width, second);
    join_tiles(all, second);
#endif
    for (int i = 0; i < 36; ++i) vstore16(all[i], 0, to + i * step + n);
  }
}

// The sum over these tiles.
// ```
// argument    type  shape            what
// v           f32   [36,tiles,Z,C]   from winograd_backward_in; 12 more words lie after it, which are read but not
//                                    used; with PAIRS u32
// e           f32   [36,tiles,Z,NP]  from winograd_backward_out; with PAIRS u32
// tiles       int                    in terms
// add         int                    if not 0, the sums are added to m
// m           f32   [36,3,C,N]       written: the sums; coefficient, dz
// work-items  groups of one: (12 channels, 32 outputs, coefficient)
// ```
kernel void winograd_backward_tile(global const Term* v, global const Term* e, int C, int N, int Z, int tiles, int add,
                                   global float* m) {
  const int c0 = GROUP_ID(0) * TILE_ROWS, n0 = GROUP_ID(1) * TILE_COLS, i = GROUP_ID(2);
  const int NP = DIV_UP(N, TILE_COLS) * TILE_COLS,
            block = max(1, 64 / Z);  // tiles whose rows stay in the first-level cache for all dz
  global const Term* pv = v + (size_t)i * tiles * Z * C + c0;
  global const Term* pe = e + (size_t)i * tiles * Z * NP + n0;
  float16 sums[3 * 2 * TILE_ROWS];
  for (int k = 0; k < 3 * 2 * TILE_ROWS; ++k) sums[k] = 0.0f;
  TILE_DECLARE
  for (int t0 = 0; t0 < tiles; t0 += block)
    for (int dz = 0; dz < 3; ++dz) {
      TILE_LOAD(sums + dz * 2 * TILE_ROWS)
      for (int t = t0; t < min(tiles, t0 + block); ++t) {
        const int from = max(0, 1 - dz), until = min(Z, Z + 1 - dz);
        global const Term* a = pv + ((size_t)t * Z + from + dz - 1) * C;
        global const Term* b = pe + ((size_t)t * Z + from) * NP;
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
