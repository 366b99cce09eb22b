// The gradient of blending (rasterize_surfels.cl), as in rasterize_backward.cl for volumes: from a picture's gradient
// to sums for each surfel in each tile.
// ```
// argument                     type  shape    what
// records, ids, starts, slots                 as in rasterize_surfels.cl and rasterize_backward.cl
// colour .. distortion, moments               blending's results; the last three are null if the gradients of
//                                             normal and distortion are
// dcolour                      f32   [H,W,3]  gradient of colour; null: zeros
// dalpha, ddepth               f32   [H,W]    gradients of alpha and depth; null: zeros
// dnormal                      f32   [H,W,3]  gradient of normal; null: zeros
// ddistortion                  f32   [H,W]    gradient of distortion; null: zeros
// rows                         f32   [N,20]   written: sums over the tile's pixels, see below
// touched                      u8    [N]      written: 1 where a row was written. Rows and bytes of surfels that no
//                                             pixel of the tile sees stay as they are
// near .. background_b                        as in rasterize_surfels.cl
// define BATCH, PIXELS                        cpu and gpu flavour, as in rasterize.cl
// define GEOMETRY                             dnormal or ddistortion is given
// work-items                   as in rasterize.cl
// ```
// With the loss's derivative h by ln alpha (0 where alpha is held at 0.99), P and Q by the numerators of s and t, B by
// their denominator 1 + g1 dx + g2 dy, L by the pixel's distance from the box's centre, and the weight w, a row is
//   h, P, Q, B, P dx, P dy, Q dx, Q dy, B dx, B dy, L (2), by z, w dcolour (3), w dnormal (3), 0.
// The derivative by alpha is as in rasterize_backward.cl, where s gains normal . dnormal and, for the distortion,
// ddistortion (m^2 W + M2 - 2 m M), with the sums W of w, M of w m and M2 of w m^2 over all surfels: a pair's share is
// counted at both.
#include "many_registers.clh"
#include "rasterize_surfels.clh"

#define COLUMNS 20

// The derivative of WARPED by depth.
#define WARPED_SLOPE(near, depth) (FAR_RATIO * (near) / ((depth) * (depth)))

#ifdef BATCH
#include "vector16.clh"

// A block's pixels of a picture with two values a pixel; 0 outside of it, or if the picture is null.
static inline void load_pairs(global const float* picture, int x, int y, int width, int height, float16* a,
                              float16* b) {
  float first[LANES], second[LANES];
  for (int i = 0; i < LANES; ++i) {
    const int px = x + i % BLOCK, py = y + i / BLOCK;
    const bool there = picture && px < width && py < height;
    const size_t at = there ? (size_t)py * width + px : 0;
    first[i] = there ? picture[2 * at] : 0.0f;
    second[i] = there ? picture[2 * at + 1] : 0.0f;
  }
  *a = vload16(0, first);
  *b = vload16(0, second);
}

// The pictures from blending, and the loss's gradients by them.
typedef struct {
  global const float *colour, *alpha, *depth, *normal, *distortion, *moments;
  global const float *dcolour, *dalpha, *ddepth, *dnormal, *ddistortion;
  int width, height;
} Pictures;

// State of each of a tile's blocks:
typedef struct {
  float16 T[BLOCKS];                                       // transmittance, 0 where a pixel is finished
  float16 gr[BLOCKS], gg[BLOCKS], gb[BLOCKS], gz[BLOCKS];  // gradients by red, green, blue, depth
  float16 base[BLOCKS];                                    // what s is without the surfel
  float16 rest[BLOCKS];                                    // the sum of w s that is still to come
#ifdef GEOMETRY
  float16 gnx[BLOCKS], gny[BLOCKS], gnz[BLOCKS];  // gradients by the normal
  float16 gd[BLOCKS];                             // by the distortion
  float16 W[BLOCKS], M[BLOCKS], M2[BLOCKS];       // sums of w, w m, w m^2
#endif
  float16 columns[BLOCK], lines[BLOCK];  // pixels' places in the tile, by the block's column and row
  uint visits[BLOCKS];                   // surfels that were blended into it
  uint alive;                            // a bit for each block that has unfinished pixels
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
    const float16 alpha = load_block(p.alpha, x, y, p.width, p.height);
    tile->gr[b] = g[0], tile->gg[b] = g[1], tile->gb[b] = g[2], tile->gz[b] = gz;
    tile->base[b] = ga - (g[0] * background_r + g[1] * background_g + g[2] * background_b);
    tile->rest[b] = g[0] * (c[0] - background_r) + g[1] * (c[1] - background_g) + g[2] * (c[2] - background_b) +
                    gz * load_block(p.depth, x, y, p.width, p.height) + ga * alpha;
#ifdef GEOMETRY
    float16 gn[3], n[3];
    load_colours(p.dnormal, x, y, p.width, p.height, gn);
    load_colours(p.normal, x, y, p.width, p.height, n);
    const float16 gd = load_block(p.ddistortion, x, y, p.width, p.height);
    tile->gnx[b] = gn[0], tile->gny[b] = gn[1], tile->gnz[b] = gn[2], tile->gd[b] = gd;
    tile->W[b] = alpha;
    load_pairs(p.moments, x, y, p.width, p.height, &tile->M[b], &tile->M2[b]);
    tile->rest[b] +=
        gn[0] * n[0] + gn[1] * n[1] + gn[2] * n[2] + 2.0f * gd * load_block(p.distortion, x, y, p.width, p.height);
#endif
    tile->T[b] =
        select((float16)(0.0f), (float16)(1.0f), (column < (float)(p.width - x)) & (row < (float)(p.height - y)));
    if (x < p.width && y < p.height) tile->alive |= 1u << b;
    tile->visits[b] = 0;
  }
  for (int b = 0; b < BLOCK; ++b)
    tile->columns[b] = column + (float)(b * BLOCK), tile->lines[b] = row + (float)(b * BLOCK);
}

// Blends a record into the blocks of `todo`, of which there is one at least. Returns the first 16 numbers of its row,
// and sets the next three. u, v: from the middle of the tile's first pixel; r0: see WARPED.
static inline float16 blend_backward(Tile* tile, Record r, float u, float v, float near, int current, float r0,
                                     uint todo, float4* facing) {
  float16 sh = 0.0f, p = 0.0f, q = 0.0f, s = 0.0f, px = 0.0f, py = 0.0f, qx = 0.0f, qy = 0.0f, sx = 0.0f, sy = 0.0f;
  float16 lx = 0.0f, ly = 0.0f, sz = 0.0f, wr = 0.0f, wg = 0.0f, wb = 0.0f, wx = 0.0f, wy = 0.0f, wz = 0.0f;
  const float16 none = 0.0f;
  do {
    const uint b = 31 - clz(todo);
    todo ^= 1u << b;
    const float16 gr = tile->gr[b], gg = tile->gg[b], gb = tile->gb[b], gz = tile->gz[b];
    const float16 dx = u - tile->columns[b % BLOCK], dy = v - tile->lines[b / BLOCK];
    const Meeting16 at = meet_rows(r, dx, dy, near, current);
    const float16 full = exp2_rows(SURFEL_LOG2_ALPHA(r, at.rho)), a = min(full, MAX_ALPHA), before = tile->T[b];
    const float16 after = before * (1.0f - a);
    const int16 seen = at.in & (full >= MIN_ALPHA), live = after >= MIN_TRANSMITTANCE, drawn = seen & live;
    const float16 left = select(before, select(none, after, live), seen);
    tile->T[b] = left;
    const float16 w = select(none, before * a, drawn), depth = select((float16)(1.0f), at.depth, drawn);
    float16 by_weight = FMA(r.tint.x, gr, FMA(r.tint.y, gg, FMA(r.tint.z, gb, FMA(depth, gz, tile->base[b]))));
    float16 by_depth = w * gz;
    COUNT_ROWS(tile, drawn);
#ifdef GEOMETRY
    const float16 gnx = tile->gnx[b], gny = tile->gny[b], gnz = tile->gnz[b], gd = tile->gd[b];
    const float16 m = WARPED(near, r0, depth), pull = FMA(m, tile->W[b], -tile->M[b]);
    by_weight +=
        FMA(r.normal.x, gnx, FMA(r.normal.y, gny, r.normal.z * gnz)) + gd * FMA(m, pull - tile->M[b], tile->M2[b]);
    by_depth += 2.0f * w * gd * pull * WARPED_SLOPE(near, depth);
    wx = FMA(w, gnx, wx);
    wy = FMA(w, gny, wy);
    wz = FMA(w, gnz, wz);
#endif
    const float16 gain = w * by_weight, behind = tile->rest[b] - gain;
    tile->rest[b] = behind;
    const float16 h = select(none, gain - a * behind / (1.0f - a), drawn & (full <= MAX_ALPHA));
    // If the surfel decides, alpha depends on s and t; depth and both depend on the denominator.
    const int16 on = drawn & at.on, inside = drawn & at.inside;
    // (Otherwise the ray may not meet it.)
    const float16 at_s = select(none, at.s, on), at_t = select(none, at.t, on);
    const float16 hq = select(none, -h * at.q, on), bp = hq * at_s, bq = hq * at_t;
    const float16 bz = select(by_depth, by_depth * at.q, inside);
    const float16 bs = -(FMA(bp, at_s, bq * at_t) + select(none, bz * depth, inside));
    const float16 h2 = select(-2.0f * h, none, on);
    sh += h;
    p += bp;
    q += bq;
    s += bs;
    px = FMA(bp, dx, px);
    py = FMA(bp, dy, py);
    qx = FMA(bq, dx, qx);
    qy = FMA(bq, dy, qy);
    sx = FMA(bs, dx, sx);
    sy = FMA(bs, dy, sy);
    lx = FMA(h2, at.bx, lx);
    ly = FMA(h2, at.by, ly);
    sz += bz;
    wr = FMA(w, gr, wr);
    wg = FMA(w, gg, wg);
    wb = FMA(w, gb, wb);
    if ((++tile->visits[b] & 7) == 0 && largest(left) == 0.0f) tile->alive &= ~(1u << b);
  } while (todo);
#ifdef GEOMETRY
  *facing = (float4)(sum_of(wx), sum_of(wy), sum_of(wz), 0.0f);
#else
  *facing = 0.0f;
#endif
  return fold1(fold2(fold4(fold8(sh, p), fold8(q, s)), fold4(fold8(px, py), fold8(qx, qy))),
               fold2(fold4(fold8(sx, sy), fold8(lx, ly)), fold4(fold8(sz, wr), fold8(wg, wb))));
}

kernel void rasterize_surfels_backward_cpu(
    global const float* records, global const uint* ids, global const uint* starts, global const uint* slots,
    global const float* colour, global const float* alpha, global const float* depth, global const float* normal,
    global const float* distortion, global const float* moments, global const float* dcolour,
    global const float* dalpha, global const float* ddepth, global const float* dnormal,
    global const float* ddistortion, global float* rows, global uchar* touched, float near, int current, int width,
    int height, int tile_x0, int tile_y0, int tiles_x, int tile_count, float background_r, float background_g,
    float background_b COUNTER_ARGUMENTS) {
  const int at = get_global_id(0);
  if (at >= tile_count) return;
  const int x0 = (tile_x0 + at % tiles_x) * TILE, y0 = (tile_y0 + at / tiles_x) * TILE;
  const float corner_x = (float)x0 + 0.5f, corner_y = (float)y0 + 0.5f;
  const Pictures pictures = {colour, alpha,  depth,   normal,      distortion, moments, dcolour,
                             dalpha, ddepth, dnormal, ddistortion, width,      height};
  Tile tile;
  start_tile(&tile, pictures, x0, y0, background_r, background_g, background_b);
  const uint end = starts[at + 1];
  const float r0 = FIRST_INVERSE(records, ids, starts[at], end);
  for (uint first = starts[at]; first < end && tile.alive; first += BATCH) {
    const uint n = min(end - first, (uint)BATCH);
    Record batch[BATCH];
    uint masks[BATCH];
    for (uint j = 0; j < n; ++j) batch[j] = load_record(records + (size_t)ids[first + j] * 20);
    reach_blocks(batch, n, corner_x, corner_y, masks);
    for (uint j = 0; j < n; ++j) {
      const uint todo = masks[j] & tile.alive;
      if (!todo) continue;
      float4 facing;
      const float16 sums = blend_backward(&tile, batch[j], batch[j].place.x - corner_x, batch[j].place.y - corner_y,
                                          near, current, r0, todo, &facing);
      global float* row = rows + (size_t)slots[first + j] * COLUMNS;
      vstore16(sums, 0, row);
      vstore4(facing, 4, row);
      touched[slots[first + j]] = 1;
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
  float base[PIXELS];   // what s is without the surfel
  float rest[PIXELS];   // the sum of w s that is still to come
#ifdef GEOMETRY
  float4 facing[PIXELS];                   // gradients by the normal, and by the distortion
  float W[PIXELS], M[PIXELS], M2[PIXELS];  // sums of w, w m, w m^2
#endif
  float left;  // the largest of T
  COUNTED(uint)
} Column;

// Blends a record into the work-item's pixels. Adds to sums [COLUMNS]; returns whether any pixel sees it.
INLINE bool blend_backward(Column* own, Record r, float near, int current, float r0, float* sums) {
  const float4 c = (float4)(r.tint.xyz, 0.0f);
  const float dx = (r.place.x - ((float)own->x0 + 0.5f)) - (float)own->x;
  const float dy0 = (r.place.y - ((float)own->y0 + 0.5f)) - (float)own->y;
  bool hit = false;
  float left = 0.0f;
#pragma unroll
  for (int p = 0; p < PIXELS; ++p) {
    const float dy = dy0 - (float)(p * STEP);
    const Meeting at = meet(r, dx, dy, near, current);
    const float full = exp2_scalar(SURFEL_LOG2_ALPHA(r, at.rho)), a = min(full, MAX_ALPHA);
    if (at.in && full >= MIN_ALPHA) {
      const float after = own->T[p] * (1.0f - a);
      if (after >= MIN_TRANSMITTANCE) {
        const float4 grad = own->grad[p];
        const float w = own->T[p] * a;
        float by_weight = dot(c, grad) + FMA(at.depth, grad.w, own->base[p]), by_depth = w * grad.w;
#ifdef GEOMETRY
        const float4 facing = own->facing[p];
        const float m = WARPED(near, r0, at.depth), pull = FMA(m, own->W[p], -own->M[p]);
        by_weight += dot(r.normal.xyz, facing.xyz) + facing.w * FMA(m, pull - own->M[p], own->M2[p]);
        by_depth += 2.0f * w * facing.w * pull * WARPED_SLOPE(near, at.depth);
        sums[16] = FMA(w, facing.x, sums[16]);
        sums[17] = FMA(w, facing.y, sums[17]);
        sums[18] = FMA(w, facing.z, sums[18]);
#endif
        const float gain = w * by_weight;
        own->rest[p] -= gain;
        const float h = full <= MAX_ALPHA ? gain - a * own->rest[p] / (1.0f - a) : 0.0f;
        // (If it is not on the surfel, s and t may be NaN.)
        const float s = at.on ? at.s : 0.0f, t = at.on ? at.t : 0.0f, h2 = at.on ? 0.0f : -2.0f * h;
        const float hq = at.on ? -h * at.q : 0.0f, bp = hq * s, bq = hq * t;
        const float bz = at.inside ? by_depth * at.q : by_depth;
        const float bs = -(FMA(bp, s, bq * t) + (at.inside ? bz * at.depth : 0.0f));
        sums[0] += h;
        sums[1] += bp;
        sums[2] += bq;
        sums[3] += bs;
        sums[4] = FMA(bp, dx, sums[4]);
        sums[5] = FMA(bp, dy, sums[5]);
        sums[6] = FMA(bq, dx, sums[6]);
        sums[7] = FMA(bq, dy, sums[7]);
        sums[8] = FMA(bs, dx, sums[8]);
        sums[9] = FMA(bs, dy, sums[9]);
        sums[10] = FMA(h2, at.bx, sums[10]);
        sums[11] = FMA(h2, at.by, sums[11]);
        sums[12] += bz;
        sums[13] = FMA(w, grad.x, sums[13]);
        sums[14] = FMA(w, grad.y, sums[14]);
        sums[15] = FMA(w, grad.z, sums[15]);
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

kernel MORE_REGISTERS void rasterize_surfels_backward_gpu(
    global const float* records, global const uint* ids, global const uint* starts, global const uint* slots,
    global const float* colour, global const float* alpha, global const float* depth, global const float* normal,
    global const float* distortion, global const float* moments, global const float* dcolour,
    global const float* dalpha, global const float* ddepth, global const float* dnormal,
    global const float* ddistortion, global float* rows, global uchar* touched, float near, int current, int width,
    int height, int tile_x0, int tile_y0, int tiles_x, int tile_count, float background_r, float background_g,
    float background_b COUNTER_ARGUMENTS) {
  local Record batch[WG];
  local int hits[WG];
  local float values[COLUMNS * (WG + PARTS)], parts[COLUMNS * PARTS];  // a column's stride avoids bank conflicts
  local int alive;
  const int item = get_local_id(0), tile = GROUP_ID(0);
  const float3 background = (float3)(background_r, background_g, background_b);
  Column own;
  COUNT_FROM_0(&own);
  own.x0 = (tile_x0 + tile % tiles_x) * TILE, own.y0 = (tile_y0 + tile / tiles_x) * TILE;
  own.x = item % TILE, own.y = item / TILE;
#pragma unroll
  for (int p = 0; p < PIXELS; ++p) {
    const int px = own.x0 + own.x, py = own.y0 + own.y + p * STEP;
    const bool inside = px < width && py < height;
    const size_t at = inside ? (size_t)py * width + px : 0;
    own.T[p] = inside ? 1.0f : 0.0f;
    own.grad[p] =
        (float4)(inside && dcolour ? vload3(at, dcolour) : (float3)(0.0f), inside && ddepth ? ddepth[at] : 0.0f);
    const float ga = inside && dalpha ? dalpha[at] : 0.0f;
    const float4 grad = own.grad[p];
    own.rest[p] = inside ? dot(grad.xyz, vload3(at, colour) - background) + grad.w * depth[at] + ga * alpha[at] : 0.0f;
    own.base[p] = ga - dot(grad.xyz, background);
#ifdef GEOMETRY
    own.facing[p] = (float4)(inside && dnormal ? vload3(at, dnormal) : (float3)(0.0f),
                             inside && ddistortion ? ddistortion[at] : 0.0f);
    own.W[p] = inside ? alpha[at] : 0.0f;
    own.M[p] = inside && moments ? moments[2 * at] : 0.0f;
    own.M2[p] = inside && moments ? moments[2 * at + 1] : 0.0f;
    if (inside && dnormal) own.rest[p] += dot(own.facing[p].xyz, vload3(at, normal));
    if (inside && ddistortion) own.rest[p] += 2.0f * own.facing[p].w * distortion[at];
#endif
  }
  const uint end = starts[tile + 1];
  const float r0 = FIRST_INVERSE(records, ids, starts[tile], end);
  int going = 1;
  for (uint first = starts[tile]; first < end && going; first += WG) {
    const uint n = min(end - first, (uint)WG);
    if (item < n) batch[item] = load_record(records + (size_t)ids[first + item] * 20);
    hits[item] = 0;
    if (item == 0) alive = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    own.left = 0.0f;
#pragma unroll
    for (int p = 0; p < PIXELS; ++p) own.left = max(own.left, own.T[p]);
    for (uint i = 0; i < n; ++i) {
      float sums[COLUMNS] = {0.0f};
      if (own.left > 0.0f && blend_backward(&own, batch[i], near, current, r0, sums)) atomic_or(&hits[i], 1);
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
