// The gradient of blending (rasterize.cl): from a picture's gradient to sums for each Gaussian in each tile.
// ```
// argument               type  shape    what
// records, ids, starts                  as in rasterize.cl
// slots                  u32   [N]      the row that each intersection's sums go to
// colour, alpha, depth   f32            blending's results, as in rasterize.cl
// dcolour                f32   [H,W,3]  gradient of colour; null: zeros
// dalpha, ddepth         f32   [H,W]    gradients of alpha and depth; null: zeros
// rows                   f32   [N,10]   written: sums over the tile's pixels of h, h dx, h t, h dx^2, h dx t, h t^2, w
//                                       dcolour (3), w ddepth
// touched                u8    [N]      written: 1 where a row was written. Rows and bytes of Gaussians that no pixel
//                                       of the tile sees stay as they are
// width .. background_b                 as in rasterize.cl
// define BATCH, PIXELS                  cpu and gpu flavour, as in rasterize.cl
// define PULL                           rows [N,2] instead: sums over the pixels of |h p|, where p is as below
// define THROUGH_CLAMP                  with PULL: h is for an alpha that is not clamped to 0.99
// work-items             as in rasterize.cl
// ```
// w is the weight of a Gaussian in a pixel, h the loss's derivative by ln alpha (0 where alpha is held at 0.99); dx, t
// as in rasterize.clh. With s = colour . dcolour + z ddepth + dalpha - background . dcolour, the derivative by a
// Gaussian's alpha is
//   T s - (sum of w s behind it) / (1 - alpha);
// the sum over all Gaussians is known from the picture, so that walking near to far, with blending's own decisions,
// suffices. Sums are taken in a fixed order.
// With PULL a row sums the magnitudes of each pixel's derivatives by the Gaussian's place on the screen, regardless of
// sign: the loss's derivatives by u and v are h times those of ln alpha, p = 2 ln 2 (qx dx - k qy t, qy t).
#include "many_registers.clh"
#include "rasterize.clh"

#ifdef PULL
#define COLUMNS 2
#else
#define COLUMNS 10
#endif
#define TWO_LN2 1.38629436f
#ifdef WEIGH
#define BY_DEPTH(z) 0.0f  // the depths that ddepth is a gradient of
#else
#define BY_DEPTH(z) (z)
#endif
// h of a pixel: gain and behind as below, a the blended alpha, full its value before the clamp to 0.99.
#ifdef THROUGH_CLAMP
#define SLOPE(gain, behind, a, full) (((gain) - (a) * (behind) / (1.0f - (a))) * ((full) / (a)))
#define IS_FREE(full) ((full) >= MIN_ALPHA)
#else
#define SLOPE(gain, behind, a, full) ((gain) - (a) * (behind) / (1.0f - (a)))
#define IS_FREE(full) ((full) <= MAX_ALPHA)
#endif

#ifdef BATCH
#include "picture_blocks.clh"
#ifdef PULL
#include "vector16.clh"
#endif

// The pictures from blending, and the loss's gradients by them.
typedef struct {
  global const float *colour, *alpha, *depth, *dcolour, *dalpha, *ddepth;
  int width, height;
} Pictures;

// State of each of a tile's blocks:
typedef struct {
  float16 T[BLOCKS];                                       // transmittance, 0 where a pixel is finished
  float16 gr[BLOCKS], gg[BLOCKS], gb[BLOCKS], gz[BLOCKS];  // gradients by red, green, blue, depth
  float16 base[BLOCKS];                                    // what s is without the Gaussian
  float16 rest[BLOCKS];                                    // the sum of w s that is still to come
  float16 columns[BLOCK], lines[BLOCK];                    // pixels' places in the tile, by the block's column and row
  uint visits[BLOCKS];                                     // Gaussians that were blended into it
  uint alive;                                              // a bit for each block that has unfinished pixels
  COUNTED(int16)
} Tile;

static inline void start_tile(Tile* tile, Pictures p, int x0, int y0, float background_r, float background_g,
                              float background_b) {
  const float16 column = (float16)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3);
  const float16 row = (float16)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
  tile->alive = 0;
  COUNT_FROM_0(tile);
  for (int b = 0; b < BLOCKS; ++b) {
    const int x = x0 + b % BLOCK * BLOCK, y = y0 + b / BLOCK * BLOCK;
    float16 g[3], c[3];
    load_colours(p.dcolour, x, y, p.width, p.height, g);
    load_colours(p.colour, x, y, p.width, p.height, c);
    const float16 gz = load_block(p.ddepth, x, y, p.width, p.height);
    const float16 ga = load_block(p.dalpha, x, y, p.width, p.height);
    tile->gr[b] = g[0], tile->gg[b] = g[1], tile->gb[b] = g[2], tile->gz[b] = gz;
    tile->base[b] = ga - (g[0] * background_r + g[1] * background_g + g[2] * background_b);
    tile->rest[b] = g[0] * (c[0] - background_r) + g[1] * (c[1] - background_g) + g[2] * (c[2] - background_b) +
                    gz * BY_DEPTH(load_block(p.depth, x, y, p.width, p.height)) +
                    ga * load_block(p.alpha, x, y, p.width, p.height);
    tile->T[b] =
        select((float16)(0.0f), (float16)(1.0f), (column < (float)(p.width - x)) & (row < (float)(p.height - y)));
    if (x < p.width && y < p.height) tile->alive |= 1u << b;
    tile->visits[b] = 0;
  }
  for (int b = 0; b < BLOCK; ++b)
    tile->columns[b] = column + (float)(b * BLOCK), tile->lines[b] = row + (float)(b * BLOCK);
}

// Some of a tile's records, number by number; u and v from the middle of the tile's first pixel.
typedef struct {
  float u[BATCH], v[BATCH], far[BATCH], lo[BATCH], k[BATCH], qx[BATCH], qy[BATCH], r[BATCH], g[BATCH], b[BATCH];
} Batch;

// Loads n records, padded with zeros to a multiple of LANES.
static inline void load_batch(Batch* batch, global const float* records, global const uint* ids, int n, int x0,
                              int y0) {
  for (int i = 0; i < n; ++i) {
    global const float* record = records + (size_t)ids[i] * 12;
    batch->u[i] = record[0] - ((float)x0 + 0.5f);
    batch->v[i] = record[1] - ((float)y0 + 0.5f);
    batch->far[i] = BY_DEPTH(record[3]);
    batch->lo[i] = record[4];
    batch->k[i] = record[5];
    batch->qx[i] = record[6];
    batch->qy[i] = record[7];
    batch->r[i] = record[8];
    batch->g[i] = record[9];
    batch->b[i] = record[10];
  }
  for (int i = n; i < DIV_UP(n, LANES) * LANES; ++i)
    batch->u[i] = batch->v[i] = batch->lo[i] = batch->k[i] = batch->qx[i] = batch->qy[i] = 0.0f;
}

// masks [BATCH]: the blocks that each of n records can reach. A block's pixel centres lie in a square 3 pixels wide.
// The margins are for rounding.
static inline void reach_blocks(const Batch* batch, int n, uint* masks) {
  for (int i = 0; i < n; i += LANES) {
    const float16 us = vload16(0, batch->u + i), vs = vload16(0, batch->v + i), ks = vload16(0, batch->k + i);
    const float16 x2 = vload16(0, batch->qx + i), t2 = vload16(0, batch->qy + i);
    const float16 room = vload16(0, batch->lo + i) + (LOG2_255 + 0.01f);
    const float16 margin = 0.01f + 1e-6f * (fabs(us) + fabs(vs) + fabs(ks * us));
    const float16 edge = (float)(BLOCK - 1) + 2.0f * margin;
    int16 mask = 0;
    for (int by = 0; by < BLOCK; ++by) {
      const float16 high = vs - (float)(BLOCK * by) + margin;
      for (int bx = 0; bx < BLOCK; ++bx) {
        const float16 right = us - (float)(BLOCK * bx) + margin;
        const float16 fall = least_fall_16(ks, x2, t2, right - edge, right, high - edge, high);
        mask |= (fall <= room) & (int16)(1 << (BLOCK * by + bx));
      }
    }
    vstore16(as_uint16(mask), 0, masks + i);
  }
}

// Blends record i into the blocks of `todo`, at least one. Returns its row: ten numbers, then zeros.
static inline float16 blend_backward(Tile* tile, const Batch* batch, int i, uint todo) {
#ifdef PULL
  float16 pull_u = 0.0f, pull_v = 0.0f;
#else
  float16 m = 0.0f, mx = 0.0f, mt = 0.0f, mxx = 0.0f, mxt = 0.0f, mtt = 0.0f;
  float16 wr = 0.0f, wg = 0.0f, wb = 0.0f, wz = 0.0f;
#endif
  const float4 form = (float4)(batch->lo[i], batch->k[i], batch->qx[i], batch->qy[i]);
  const float u = batch->u[i], v = batch->v[i], far = batch->far[i];
  const float red = batch->r[i], green = batch->g[i], blue = batch->b[i];
  do {
    const uint b = 31 - clz(todo);
    todo ^= 1u << b;
    const float16 gr = tile->gr[b], gg = tile->gg[b], gb = tile->gb[b], gz = tile->gz[b];
    const float16 dx = u - tile->columns[b % BLOCK], dy = v - tile->lines[b / BLOCK];
    const float16 t = SHEARED(form, dx, dy);
    const float16 full = exp2_rows(LOG2_ALPHA(form, dx, t)), a = min(full, MAX_ALPHA), before = tile->T[b];
    const float16 after = before * (1.0f - a);
    const int16 seen = full >= MIN_ALPHA, live = after >= MIN_TRANSMITTANCE;
    const float16 left = select(before, select((float16)(0.0f), after, live), seen);
    tile->T[b] = left;
    const float16 w = select((float16)(0.0f), before * a, seen & live);
    COUNT_ROWS(tile, seen & live);
    const float16 gain = w * FMA(red, gr, FMA(green, gg, FMA(blue, gb, FMA(far, gz, tile->base[b]))));
    const float16 behind = tile->rest[b] - gain;
    tile->rest[b] = behind;
    const float16 h = select((float16)(0.0f), SLOPE(gain, behind, a, full), seen & live & IS_FREE(full));
#ifdef PULL
    const float16 pv = form.w * t;
    pull_u += fabs(h * (form.z * dx - form.y * pv));
    pull_v += fabs(h * pv);
#else
    const float16 hx = h * dx, ht = h * t;
    m += h;
    mx += hx;
    mt += ht;
    mxx = FMA(hx, dx, mxx);
    mxt = FMA(hx, t, mxt);
    mtt = FMA(ht, t, mtt);
    wr = FMA(w, gr, wr);
    wg = FMA(w, gg, wg);
    wb = FMA(w, gb, wb);
    wz = FMA(w, gz, wz);
#endif
    if ((++tile->visits[b] & 7) == 0 && largest(left) == 0.0f) tile->alive &= ~(1u << b);
  } while (todo);
#ifdef PULL
  float16 sums = 0.0f;
  sums.s0 = TWO_LN2 * sum_of(pull_u);
  sums.s1 = TWO_LN2 * sum_of(pull_v);
  return sums;
#else
  return fold1(fold2(fold4(fold8(m, mx), fold8(mt, mxx)), fold4(fold8(mxt, mtt), fold8(wr, wg))),
               fold2(fold4(fold8(wb, wz), (float16)(0.0f)), (float16)(0.0f)));
#endif
}

kernel void rasterize_backward_cpu(global const float* records, global const uint* ids, global const uint* starts,
                                   global const uint* slots, global const float* colour, global const float* alpha,
                                   global const float* depth, global const float* dcolour, global const float* dalpha,
                                   global const float* ddepth, global float* rows, global uchar* touched, int width,
                                   int height, int tile_x0, int tile_y0, int tiles_x, int tile_count,
                                   float background_r, float background_g, float background_b COUNTER_ARGUMENTS) {
  const int at = get_global_id(0);
  if (at >= tile_count) return;
  const int x0 = (tile_x0 + at % tiles_x) * TILE, y0 = (tile_y0 + at / tiles_x) * TILE;
  const Pictures pictures = {colour, alpha, depth, dcolour, dalpha, ddepth, width, height};
  Tile tile;
  start_tile(&tile, pictures, x0, y0, background_r, background_g, background_b);
  const uint end = starts[at + 1];
  for (uint first = starts[at]; first < end && tile.alive; first += BATCH) {
    const int n = min(end - first, (uint)BATCH);
    Batch batch;
    uint masks[BATCH];
    load_batch(&batch, records, ids + first, n, x0, y0);
    reach_blocks(&batch, n, masks);
    for (int i = 0; i < n; ++i) {
      const uint todo = masks[i] & tile.alive;
      if (!todo) continue;
      const float16 sums = blend_backward(&tile, &batch, i, todo);
      const uint slot = slots[first + i];
#ifdef PULL
      vstore2(sums.s01, slot, rows);
#else
      vstore8(sums.lo, 0, rows + (size_t)slot * COLUMNS);
      vstore2(sums.s89, 0, rows + (size_t)slot * COLUMNS + 8);
#endif
      touched[slot] = 1;
    }
  }
  ADD_COUNT(sum_of_counts(tile.blended));
}
#endif

#ifdef PIXELS
#define WG (TILE * TILE / PIXELS)
#define STEP (TILE / PIXELS)  // rows between an item's pixels
#include "rows_gpu.clh"

// State of a work-item's pixels, which lie in column x of the tile at (x0, y0), STEP rows apart from row y on:
typedef struct {
  int x0, y0, x, y;
  float T[PIXELS];      // transmittance, 0 where a pixel is finished
  float4 grad[PIXELS];  // gradients by red, green, blue, depth
  float base[PIXELS];   // what s is without the Gaussian
  float rest[PIXELS];   // the sum of w s that is still to come
  float left;           // the largest of T
  COUNTED(uint)
} Column;

INLINE void start_column(Column* own, global const float* colour, global const float* alpha, global const float* depth,
                         global const float* dcolour, global const float* dalpha, global const float* ddepth, int width,
                         int height, float3 background) {
#pragma unroll
  for (int p = 0; p < PIXELS; ++p) {
    const int px = own->x0 + own->x, py = own->y0 + own->y + p * STEP;
    const bool inside = px < width && py < height;
    const size_t at = inside ? (size_t)py * width + px : 0;
    own->T[p] = inside ? 1.0f : 0.0f;
    float4 grad = 0.0f;
    if (inside && dcolour) grad.xyz = vload3(at, dcolour);
    if (inside && ddepth) grad.w = ddepth[at];
    const float ga = inside && dalpha ? dalpha[at] : 0.0f;
    own->grad[p] = grad;
    own->rest[p] =
        inside ? dot(grad.xyz, vload3(at, colour) - background) + grad.w * BY_DEPTH(depth[at]) + ga * alpha[at] : 0.0f;
    own->base[p] = ga - dot(grad.xyz, background);
  }
}

// Blends a record (place, form and tint are its twelve numbers) into the work-item's pixels. Adds to sums [COLUMNS];
// returns whether any pixel sees it.
INLINE bool blend_backward(Column* own, float4 at, float4 f, float4 tint, float* sums) {
  const float4 c = (float4)(tint.xyz, BY_DEPTH(at.w));
  const float dx = (at.x - ((float)own->x0 + 0.5f)) - (float)own->x;
  bool hit = false;
  float left = 0.0f;
#pragma unroll
  for (int p = 0; p < PIXELS; ++p) {
    const float dy = (at.y - ((float)own->y0 + 0.5f)) - (float)(own->y + p * STEP), t = SHEARED(f, dx, dy);
    const float full = exp2_scalar(LOG2_ALPHA(f, dx, t)), a = min(full, MAX_ALPHA);
    if (full >= MIN_ALPHA) {
      const float after = own->T[p] * (1.0f - a);
      if (after >= MIN_TRANSMITTANCE) {
        const float4 grad = own->grad[p];
        const float w = own->T[p] * a, gain = w * (dot(c, grad) + own->base[p]);
        own->rest[p] -= gain;
        const float h = IS_FREE(full) ? SLOPE(gain, own->rest[p], a, full) : 0.0f;
#ifdef PULL
        const float pv = f.w * t;
        sums[0] += TWO_LN2 * fabs(h * (f.z * dx - f.y * pv));
        sums[1] += TWO_LN2 * fabs(h * pv);
#else
        const float hx = h * dx, ht = h * t;
        sums[0] += h;
        sums[1] += hx;
        sums[2] += ht;
        sums[3] = FMA(hx, dx, sums[3]);
        sums[4] = FMA(hx, t, sums[4]);
        sums[5] = FMA(ht, t, sums[5]);
        sums[6] = FMA(w, grad.x, sums[6]);
        sums[7] = FMA(w, grad.y, sums[7]);
        sums[8] = FMA(w, grad.z, sums[8]);
        sums[9] = FMA(w, grad.w, sums[9]);
#endif
        COUNT_ONE(own);
        hit = true;
        own->T[p] = after;
      } else {
        own->T[p] = 0.0f;
      }
    }
    left = max(left, own->T[p]);
  }
  own->left = left;
  return hit;
}

kernel MORE_REGISTERS void rasterize_backward_gpu(
    global const float* records, global const uint* ids, global const uint* starts, global const uint* slots,
    global const float* colour, global const float* alpha, global const float* depth, global const float* dcolour,
    global const float* dalpha, global const float* ddepth, global float* rows, global uchar* touched, int width,
    int height, int tile_x0, int tile_y0, int tiles_x, int tile_count, float background_r, float background_g,
    float background_b COUNTER_ARGUMENTS) {
  local float4 place[WG], form[WG], tint[WG];
  local int hits[WG];
  local float values[COLUMNS * (WG + PARTS)], parts[COLUMNS * PARTS];  // a column's stride avoids bank conflicts
  local int alive;
  const int item = get_local_id(0), tile = GROUP_ID(0);
  Column own;
  COUNT_FROM_0(&own);
  own.x0 = (tile_x0 + tile % tiles_x) * TILE, own.y0 = (tile_y0 + tile / tiles_x) * TILE;
  own.x = item % TILE, own.y = item / TILE;
  start_column(&own, colour, alpha, depth, dcolour, dalpha, ddepth, width, height,
               (float3)(background_r, background_g, background_b));
  const uint end = starts[tile + 1];
  int going = 1;
  for (uint first = starts[tile]; first < end && going; first += WG) {
    const uint n = min(end - first, (uint)WG);
    if (item < n) {
      const size_t id = ids[first + item];
      place[item] = vload4(0, records + id * 12);
      form[item] = vload4(1, records + id * 12);
      tint[item] = vload4(2, records + id * 12);
    }
    hits[item] = 0;
    if (item == 0) alive = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    own.left = 0.0f;
#pragma unroll
    for (int p = 0; p < PIXELS; ++p) own.left = max(own.left, own.T[p]);
    for (uint i = 0; i < n; ++i) {
      float sums[COLUMNS] = {0.0f};
      if (own.left > 0.0f && blend_backward(&own, place[i], form[i], tint[i], sums)) atomic_or(&hits[i], 1);
      write_row(sums, hits + i, values, parts, slots + first + i, rows, touched);
    }
    if (own.left > 0.0f) atomic_or(&alive, 1);
    barrier(CLK_LOCAL_MEM_FENCE);
    going = alive;
    barrier(CLK_LOCAL_MEM_FENCE);  // before the next batch overwrites it
  }
  ADD_COUNT(own.blended);
}
#endif
