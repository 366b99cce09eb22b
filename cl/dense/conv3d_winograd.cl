// 3x3x3 convolution, stride 1, zero padding 1, of a channels-last volume [X,Y,Z,C], cpu flavour, by Winograd's F(4x4,
// 3x3) over x and y and directly along z: 36 products where the direct sum needs 144. A tile is 4 x 4 columns of
// outputs, from 6 x 6 columns of inputs d: out = A^T [(G g G^T) . (B^T d B)] A, with G g G^T computed before. Tile t of
// the volume is at x = 4 (t / TY), y = 4 (t mod TY), TY = ceil(Y/4). Along z a tile is cut in ZT = ceil(Z/12) parts of
// 12 outputs; part zt has the inputs z = 12 zt - 1 + j, j = 0 .. 13. In mixed precision all are built with PAIRS: the
// transformed numbers are rounded, and pairs are two neighbouring channels (pairs_cpu.clh).
// flavour: cpu
#define PACK_ROWS 14
#ifdef PAIRS
#define BLOCK 8  // terms of 16 channels
#else
#define BLOCK 16
#endif
#define TILE_STRIDE BLOCK
#include "conv3d.clh"
#ifdef MATRIX_AMX
#include "amx.clh"
#endif
#include "term_tile_cpu.clh"
#include "winograd.clh"

// G g G^T of 16 output channels.
// ```
// argument  type     shape    what
// taps      f32      [27,32]  g: tap, output channel
// part      int               2 dz + which half of the output channels
// to        float16  [36]     written
// ```
static inline void transform_taps(const float* taps, int part, float16* to) {
  const int dz = part / 2, from_n = 16 * (part % 2);
  float16 half_way[18];  // dy, coefficient along x
  for (int dy = 0; dy < 3; ++dy) {
    const float* from = taps + (dy * 3 + dz) * TILE_COLS + from_n;
    transform_weights(vload16(0, from), vload16(0, from + 9 * TILE_COLS), vload16(0, from + 18 * TILE_COLS),
                      half_way + 6 * dy);
  }
  for (int i = 0; i < 6; ++i) transform_weights(half_way[i], half_way[6 + i], half_way[12 + i], to + 6 * i);
}

static inline void load_taps(global const float* w, int mirrored, int C, int N, int n0, int c, float* taps) {
  for (int j = 0; j < TILE_COLS; ++j)
    for (int t = 0; t < 27; ++t) taps[t * TILE_COLS + j] = c < C ? weight_of(w, mirrored, N, C, n0 + j, c, t) : 0.0f;
}

// ```
// argument    type  shape                   what
// w           f32   [N,C,27]                weights as PyTorch has them; see conv3d.clh for mirrored
// u           f32   [ceil(N/32),36,C,3,32]  written: G g G^T; panel, coefficient, then 16 channels after another (the
//                                           last ones fewer): dz, channel, 32 output channels; zero beyond N. PAIRS:
//                                           u32 [ceil(N/32),36,ceil(C/2),3,32]; zero beyond C
// work-items  groups of one: (panel, input channel); PAIRS: (panel, pair of input channels)
// ```
kernel void winograd_pack_weights(global const float* w, int mirrored, int C, int N, global Term* u) {
  const int n0 = GROUP_ID(0) * TILE_COLS, c = GROUP_ID(1);  // c: in terms
  const int c0 = c / BLOCK * BLOCK, width = min(BLOCK, TERMS_OF(C) - c0);
  global Term* to = u + ((size_t)GROUP_ID(0) * 36 * TERMS_OF(C) * 3 + c0 * 3 + c - c0) * TILE_COLS;
  float taps[27 * TILE_COLS];
#ifdef PAIRS
  float seconds[27 * TILE_COLS];
  load_taps(w, mirrored, C, N, n0, 2 * c, taps);
  load_taps(w, mirrored, C, N, n0, 2 * c + 1, seconds);
#else
  load_taps(w, mirrored, C, N, n0, c, taps);
#endif
  for (int part = 0; part < 6; ++part) {
    const int dz = part / 2, from_n = 16 * (part % 2);
    float16 all[36];
    transform_taps(taps, part, all);
#ifdef PAIRS
    float16 second[36];
    transform_taps(seconds, part, second);
#endif
    for (int i = 0; i < 36; ++i) {
#ifdef PAIRS
      const Term16 value = pairs_of(all[i], second[i]);
#else
      const Term16 value = all[i];
#endif
      vstore16(value, 0, to + ((size_t)i * TERMS_OF(C) * 3 + dz * width) * TILE_COLS + from_n);
    }
  }
}

#ifdef PAIRS
typedef ushort Packed;
#else
typedef float Packed;
#endif

// One source around one tile, composed and transformed.
// ```
// argument            type  shape              what
// x                   f32   [X,Y,Z,count]      source
// scale, shift        f32   [count]            null: neither
// x_first .. z_first  int                      the corner of the tile's inputs; may lie outside the volume
// blocks              int                      ceil(C/16)
// first               int                      the source's first channel of the C
// to                  f32   [36,blocks,14,16]  written: channels first .. first + count - 1; PAIRS: u16, the operands
// ```
static inline void pack_source(global const float* x, int count, global const float* scale, global const float* shift,
                               int silu, int X, int Y, int Z, int x_first, int y_first, int z_first, int blocks,
                               int first, global Packed* to) {
  for (int c = 0; c < count; c += 16) {
    const int width = min(16, count - c), channel = first + c;
    const float16 a = scale ? load_part(scale + c, width) : (float16)(1.0f);
    const float16 b = scale ? load_part(shift + c, width) : (float16)(0.0f);
#ifdef PAIRS
    ushort16 before[36];
#endif
    for (int j = 0; j < PACK_ROWS; ++j) {
      const int z = z_first + j;
      float16 d[36];
      if (z < 0 || z >= Z) {
#pragma unroll
        for (int i = 0; i < 36; ++i) d[i] = (float16)(0.0f);
      } else {
        for (int i = 0; i < 6; ++i) {
          const int px = x_first + i;
          float16 line[6];
#pragma unroll
          for (int k = 0; k < 6; ++k) {
            const int py = y_first + k;
            line[k] = (float16)(0.0f);
            if (px < 0 || px >= X || py < 0 || py >= Y) continue;
            global const float* from = x + ((size_t)(px * Y + py) * Z + z) * count + c;
            PREFETCH(from + count)
            float16 value = load_part(from, width);
            if (scale) value = FMA(value, a, b);
            line[k] = silu ? silu_16(value) : value;
          }
          transform_in(line, d + 6 * i, 1);
        }
#pragma unroll
        for (int i = 0; i < 6; ++i) transform_in(d + i, d + i, 6);
      }
      if (width == 16 && channel % 16 == 0) {
        for (int i = 0; i < 36; ++i) {
          global Packed* row = to + ((size_t)(i * blocks + channel / 16) * PACK_ROWS + j) * 16;
#ifdef PAIRS
          // Two rows at a time: whole lines of a cache.
          const ushort16 v = operands_of(d[i]);
          if (j % 2 == 0)
            before[i] = v;
          else
            vstore16((uint16)(as_uint8(before[i]), as_uint8(v)), 0, (global uint*)(row - 16));
#else
          vstore16(d[i], 0, row);
#endif
        }
      } else {
        for (int i = 0; i < 36; ++i) {
          Packed values[16];
#ifdef PAIRS
          vstore16(operands_of(d[i]), 0, values);
#else
          vstore16(d[i], 0, values);
#endif
          for (int k = 0; k < width; ++k)
            to[((size_t)(i * blocks + (channel + k) / 16) * PACK_ROWS + j) * 16 + (channel + k) % 16] = values[k];
        }
      }
    }
  }
}

// ```
// argument      type  shape                           what
// x0            f32   [X,Y,Z,c0]                      first source
// x1            f32   [X,Y,Z,c1]                      second source; null: none, c1 = 0
// scale, shift  f32   [c0+c1]                         composed as compose_rows.cl says; null: neither
// silu          int                                   whether SiLU is applied; the padding is zero after all that
// tile0         int                                   the first tile that is packed
// v             f32   [tiles,ZT,36,ceil(C/16),14,16]  written: B^T d B; 16 channels side by side, the last block
//                                                     has only those below C. PAIRS: u32
//                                                     [tiles,ZT,36,ceil(C/16),14,8]; a last second operand is zero
// work-items    groups of one: (zt, tile from tile0 on)
// ```
kernel void winograd_forward_pack(global const float* x0, int c0, global const float* x1, int c1,
                                  global const float* scale, global const float* shift, int silu, int X, int Y, int Z,
                                  int tile0, global Term* v) {
  const int zt = GROUP_ID(0), ZT = DIV_UP(Z, TILE_ROWS), TY = DIV_UP(Y, 4);
  const int t = GROUP_ID(1), tile = tile0 + t;
  const int x = 4 * (tile / TY) - 1, y = 4 * (tile % TY) - 1, z = TILE_ROWS * zt - 1;
  const int blocks = DIV_UP(c0 + c1, 16);
  global Packed* to = (global Packed*)v + ((size_t)t * ZT + zt) * 36 * blocks * PACK_ROWS * 16;
  pack_source(x0, c0, scale, shift, silu, X, Y, Z, x, y, z, blocks, 0, to);
  if (c1)
    pack_source(x1, c1, scale ? scale + c0 : scale, scale ? shift + c0 : shift, silu, X, Y, Z, x, y, z, blocks, c0, to);
#ifdef PAIRS
  if ((c0 + c1) % 2)
    for (int i = 0; i < 36; ++i)
      for (int j = 0; j < PACK_ROWS; ++j) to[((i * blocks + blocks - 1) * PACK_ROWS + j) * 16 + (c0 + c1) % 16] = 0;
#endif
}

#define WINOGRAD_TILES 4

#ifdef MATRIX_AMX
// The registers: 0 .. 3 are the sums of two parts, each [12, 32]; 4 and 6 hold the operands of the planes dz = 0 and 1
// of 16 channels, which lie behind each other in v's rows and in u, and 5 and 7 those of dz = 2.
static inline void amx_winograd_shapes(AmxShapes* shapes) {
  amx_full_shapes(shapes);
  for (int t = 0; t < 6; ++t) amx_shape(shapes, t, TILE_ROWS, t == 5 ? BLOCK : 16);
  amx_shape(shapes, 7, BLOCK, 16);
}

#define AMX_PLANES(lo, a)             \
  AMX_LOAD(4, (a), BLOCK)             \
  AMX_MULTIPLY(lo, 4, 6)              \
  AMX_LOAD(5, (a) + 2 * BLOCK, BLOCK) \
  AMX_MULTIPLY(lo, 5, 7)
#define AMX_PLANES_OF_U(b)    \
  AMX_LOAD(6, (b), TILE_COLS) \
  AMX_LOAD(7, (b) + 2 * BLOCK * TILE_COLS, TILE_COLS)

// The products of one coefficient, for one or two parts of tiles: two of a [C/16, 14, 8] of pairs, `next` words apart,
// with b [C/16, 3, 8, 32], where C is a multiple of 16. Written: t [12, 32], and that of the second part 36 further on.
static inline void amx_winograd(global const Term* a, size_t next, global const Term* b, int C, int both, float* t) {
  AMX_ZERO_32
  for (int c = 0; c < C; c += 16, a += PACK_ROWS * BLOCK, b += 3 * BLOCK * TILE_COLS) {
    AMX_PLANES_OF_U(b)
    AMX_PLANES(0, a)
    if (both) {
      AMX_PLANES(2, a + next)
    }
    AMX_PLANES_OF_U(b + 16)
    AMX_PLANES(1, a)
    if (both) {
      AMX_PLANES(3, a + next)
    }
  }
  AMX_STORE(0, t, TILE_COLS)
  AMX_STORE(1, t + 16, TILE_COLS)
  if (!both) return;
  t += 36 * TILE_ROWS * TILE_COLS;
  AMX_STORE(2, t, TILE_COLS)
  AMX_STORE(3, t + 16, TILE_COLS)
}
#endif

// Computes some parts of tiles: 12 outputs along z of a tile's 4 x 4 columns, times 32 channels. It goes coefficient by
// coefficient: u's numbers of one stay in the first-level cache for all parts, whereas a panel of u would not fit.
// ```
// argument    type  shape                           what
// v           f32   [tiles,ZT,36,ceil(C/16),14,16]  from winograd_forward_pack
// u           f32   [ceil(N/32),36,C,3,32]          from winograd_pack_weights
// tile0       int                                   the first tile of v
// count       int                                   parts of tiles in v
// each        int                                   parts of a work-item, at most WINOGRAD_TILES
// bias        f32   [N]                             null: none
// residual    f32   [X,Y,Z,N]                       null: none; may be out
// out         f32   [X,Y,Z,N]                       written: the tiles of v
// work-items  groups of one: (`each` of zt + ZT tile, panel of u)
// ```
kernel void winograd_forward_tile(global const Term* v, global const Term* u, int C, int N, int X, int Y, int Z,
                                  int tile0, int count, int each, global const float* bias,
                                  global const float* residual, global float* out) {
  const int ZT = DIV_UP(Z, TILE_ROWS), TY = DIV_UP(Y, 4), first = GROUP_ID(0) * each, here = min(each, count - first);
  const int n0 = GROUP_ID(1) * TILE_COLS;
  const size_t coefficient = (size_t)DIV_UP(C, 16) * PACK_ROWS * BLOCK;
  // for each tile: coefficient, z, half of the channels
  float16 products[WINOGRAD_TILES * 36 * 2 * TILE_ROWS];
#ifdef MATRIX_AMX
  AmxShapes shapes;
  amx_winograd_shapes(&shapes);
  AMX_BEGIN(&shapes)
  for (int i = 0; i < 36; ++i)
    for (int p = 0; p < here; p += 2)
      amx_winograd(v + ((size_t)(first + p) * 36 + i) * coefficient, 36 * coefficient,
                   u + ((size_t)n0 * 36 + (size_t)i * TILE_COLS) * TERMS_OF(C) * 3, C, p + 1 < here,
                   (float*)(products + (p * 36 + i) * 2 * TILE_ROWS));
  AMX_END
#else
  for (int i = 0; i < 36; ++i) {
    for (int p = 0; p < here; ++p) {
      global const Term* pa = v + ((size_t)(first + p) * 36 + i) * coefficient;
      global const Term* pb = u + ((size_t)n0 * 36 + (size_t)i * TILE_COLS) * TERMS_OF(C) * 3;
      TILE_DECLARE
      for (int c0 = 0; c0 < C; c0 += 16) {
        const int width = TERMS_OF(min(16, C - c0));
        // Loops over planes along z, not over channels: otherwise the numbers of v that three planes share would stay
        // in registers and displace sums.
#pragma unroll 1
        for (int dz = 0; dz < 3; ++dz) {
#pragma unroll 4
          for (int c = 0; c < width; ++c, pb += TILE_COLS) TILE_STEP(pa + BLOCK * dz + c, pb)
        }
        pa += PACK_ROWS * BLOCK;
      }
      TILE_STORE(products + (p * 36 + i) * 2 * TILE_ROWS)
    }
  }
#endif
  for (int p = 0; p < here; ++p) {
    float16* m = products + p * 36 * 2 * TILE_ROWS;
    const int tile = tile0 + (first + p) / ZT, z0 = TILE_ROWS * ((first + p) % ZT);
    const int rows = min(TILE_ROWS, Z - z0), x0 = 4 * (tile / TY), y0 = 4 * (tile % TY);
    float16 o[16 * 2 * TILE_ROWS];  // column, z, half of the channels
    for (int i = 0; i < 2 * rows; ++i) {
      float16 half_way[24];
#pragma unroll
      for (int k = 0; k < 6; ++k) transform_out(m + (6 * k) * 2 * TILE_ROWS + i, 2 * TILE_ROWS, half_way + 4 * k, 1);
#pragma unroll
      for (int k = 0; k < 4; ++k) transform_out(half_way + k, 4, o + k * 2 * TILE_ROWS + i, 4 * 2 * TILE_ROWS);
    }
    for (int i = 0; i < 16; ++i) {
      const int x = x0 + i / 4, y = y0 + i % 4;
      if (x >= X || y >= Y) continue;
      const size_t at = ((size_t)(x * Y + y) * Z + z0) * N + n0;
      tile_finish(o + i * 2 * TILE_ROWS, rows, 2, n0, N, bias, 0, residual ? residual + at : residual, out + at);
    }
  }
}
