// Blending of surfels, near to far: like that of volumes (rasterize.cl), but alpha and depth are those of the point
// where a pixel's ray meets a surfel, and there are more maps.
// ```
// argument              type  shape    what
// records               f32   [V,20]   as project_surfels.cl writes them
// ids, starts                          as in rasterize.cl
// colour, alpha, depth  f32            written, as in rasterize.cl
// normal                f32   [H,W,3]  written: sum of weight x normal, in the camera's axes; null: not written
// median                f32   [H,W]    written: the depth of the last surfel that met a transmittance over 0.5, 0 if
//                                      none did; null: not written
// distortion            f32   [H,W]    written: sum over pairs i > j of w_i w_j (m_i - m_j)^2, with the warped depth m
//                                      of rasterize_surfels.clh; null: not written
// moments               f32   [H,W,2]  written: sums of w m and of w m^2, for the derivative; null: not written
// near                  float          nearer intersections are ignored
// current               int            as in project_surfels.cl
// width .. background_b                as in rasterize.cl
// define BATCH, PIXELS                 cpu and gpu flavour, as in rasterize.cl
// define GEOMETRY                      normal, median, distortion or moments are wanted
// work-items            as in rasterize.cl
// ```
#include "many_registers.clh"
#include "rasterize_surfels.clh"

#ifdef BATCH
// State of each of a tile's blocks:
typedef struct {
  float16 T[BLOCKS];                                              // transmittance, 0 where a pixel is finished
  float16 red[BLOCKS], green[BLOCKS], blue[BLOCKS], far[BLOCKS];  // sums of weight x colour, weight x depth
  float16 sum[BLOCKS];                                            // sums of weights
#ifdef GEOMETRY
  float16 nx[BLOCKS], ny[BLOCKS], nz[BLOCKS], median[BLOCKS], distortion[BLOCKS];
  float16 m[BLOCKS], mm[BLOCKS];  // sums of weight x m, weight x m^2
#endif
  float16 columns[BLOCK], lines[BLOCK];  // pixels' places in the tile, by the block's column and row
  uint alive;                            // a bit for each block that has unfinished pixels
  COUNTED(int16)
} Tile;

static inline void start_tile(Tile* tile, int x0, int y0, int width, int height) {
  const float16 column = (float16)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3);
  const float16 row = (float16)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
  tile->alive = 0;
  COUNT_FROM_0(tile);
  for (int b = 0; b < BLOCKS; ++b) {
    const int x = x0 + b % BLOCK * BLOCK, y = y0 + b / BLOCK * BLOCK;
    tile->T[b] = select((float16)(0.0f), (float16)(1.0f), (column < (float)(width - x)) & (row < (float)(height - y)));
    tile->red[b] = tile->green[b] = tile->blue[b] = tile->sum[b] = tile->far[b] = 0.0f;
#ifdef GEOMETRY
    tile->nx[b] = tile->ny[b] = tile->nz[b] = tile->median[b] = tile->distortion[b] = tile->m[b] = tile->mm[b] = 0.0f;
#endif
    if (x < width && y < height) tile->alive |= 1u << b;
  }
  for (int b = 0; b < BLOCK; ++b)
    tile->columns[b] = column + (float)(b * BLOCK), tile->lines[b] = row + (float)(b * BLOCK);
}

// Blends a record into the blocks of `rest`. u, v: from the middle of the tile's first pixel; r0: see WARPED.
static inline void blend(Tile* tile, Record r, float u, float v, float near, int current, float r0, uint rest) {
  for (; rest; rest &= rest - 1) {
    const uint b = 31 - clz(rest & -rest);
    const Meeting16 at = meet_rows(r, u - tile->columns[b % BLOCK], v - tile->lines[b / BLOCK], near, current);
    const float16 full = exp2_rows(SURFEL_LOG2_ALPHA(r, at.rho)), a = min(full, MAX_ALPHA);
    const float16 before = tile->T[b], after = before * (1.0f - a);
    const int16 seen = at.in & (full >= MIN_ALPHA), live = after >= MIN_TRANSMITTANCE, drawn = seen & live;
    const float16 w = select((float16)(0.0f), before * a, drawn);
    COUNT_ROWS(tile, drawn);
    const float16 depth = select((float16)(1.0f), at.depth, drawn);  // a surfel that is not drawn may not be met at all
    tile->T[b] = select(before, select((float16)(0.0f), after, live), seen);
    tile->red[b] = FMA(w, (float16)(r.tint.x), tile->red[b]);
    tile->green[b] = FMA(w, (float16)(r.tint.y), tile->green[b]);
    tile->blue[b] = FMA(w, (float16)(r.tint.z), tile->blue[b]);
    tile->far[b] = FMA(w, depth, tile->far[b]);
#ifdef GEOMETRY
    tile->nx[b] = FMA(w, (float16)(r.normal.x), tile->nx[b]);
    tile->ny[b] = FMA(w, (float16)(r.normal.y), tile->ny[b]);
    tile->nz[b] = FMA(w, (float16)(r.normal.z), tile->nz[b]);
    tile->median[b] = select(tile->median[b], depth, drawn & (before > 0.5f));
    const float16 m = WARPED(near, r0, depth), wm = w * m;
    tile->distortion[b] += w * FMA(m, FMA(m, tile->sum[b], -2.0f * tile->m[b]), tile->mm[b]);
    tile->m[b] += wm;
    tile->mm[b] = FMA(wm, m, tile->mm[b]);
#endif
    tile->sum[b] += w;
  }
}

// Writes a block of a picture with two values a pixel, as far as it is in the picture.
static inline void store_pairs(float16 a, float16 b, global float* picture, int x, int y, int width, int height) {
  const float8 rows[] = {(float8)(a.s0, b.s0, a.s1, b.s1, a.s2, b.s2, a.s3, b.s3),
                         (float8)(a.s4, b.s4, a.s5, b.s5, a.s6, b.s6, a.s7, b.s7),
                         (float8)(a.s8, b.s8, a.s9, b.s9, a.sa, b.sa, a.sb, b.sb),
                         (float8)(a.sc, b.sc, a.sd, b.sd, a.se, b.se, a.sf, b.sf)};
  const float* pairs = (const float*)rows;
  for (int row = 0; row < BLOCK && y + row < height; ++row)
    for (int i = 0; i < BLOCK && x + i < width; ++i)
      vstore2(vload2(BLOCK * row + i, pairs), (size_t)(y + row) * width + x + i, picture);
}

kernel void rasterize_surfels_forward_cpu(global const float* records, global const uint* ids,
                                          global const uint* starts, global float* colour, global float* alpha,
                                          global float* depth, global float* normal, global float* median,
                                          global float* distortion, global float* moments, float near, int current,
                                          int width, int height, int tile_x0, int tile_y0, int tiles_x, int tile_count,
                                          float background_r, float background_g,
                                          float background_b COUNTER_ARGUMENTS) {
  const int at = get_global_id(0);
  if (at >= tile_count) return;
  const int x0 = (tile_x0 + at % tiles_x) * TILE, y0 = (tile_y0 + at / tiles_x) * TILE;
  const float corner_x = (float)x0 + 0.5f, corner_y = (float)y0 + 0.5f;
  Tile tile;
  start_tile(&tile, x0, y0, width, height);
  const uint end = starts[at + 1];
  const float r0 = FIRST_INVERSE(records, ids, starts[at], end);
  for (uint first = starts[at]; first < end && tile.alive; first += BATCH) {
    const uint n = min(end - first, (uint)BATCH);
    Record batch[BATCH];
    uint masks[BATCH];
    for (uint j = 0; j < n; ++j) batch[j] = load_record(records + (size_t)ids[first + j] * 20);
    reach_blocks(batch, n, corner_x, corner_y, masks);
    for (uint j = 0; j < n; ++j)
      blend(&tile, batch[j], batch[j].place.x - corner_x, batch[j].place.y - corner_y, near, current, r0,
            masks[j] & tile.alive);
    for (uint b = 0; b < BLOCKS; ++b)
      if (largest(tile.T[b]) == 0.0f) tile.alive &= ~(1u << b);
  }
  for (int b = 0; b < BLOCKS; ++b) {
    const int x = x0 + b % BLOCK * BLOCK, y = y0 + b / BLOCK * BLOCK;
    if (x >= width || y >= height) continue;
    const float16 left = 1.0f - tile.sum[b];
    const float16 over[] = {FMA(left, (float16)(background_r), tile.red[b]),
                            FMA(left, (float16)(background_g), tile.green[b]),
                            FMA(left, (float16)(background_b), tile.blue[b])};
    store_colours(over, colour, x, y, width, height);
    store_block(tile.sum[b], alpha, x, y, width, height);
    store_block(tile.far[b], depth, x, y, width, height);
#ifdef GEOMETRY
    const float16 facing[] = {tile.nx[b], tile.ny[b], tile.nz[b]};
    if (normal) store_colours(facing, normal, x, y, width, height);
    if (median) store_block(tile.median[b], median, x, y, width, height);
    if (distortion) store_block(tile.distortion[b], distortion, x, y, width, height);
    if (moments) store_pairs(tile.m[b], tile.mm[b], moments, x, y, width, height);
#endif
  }
  ADD_COUNT(sum_of_counts(tile.blended));
}
#endif

#ifdef PIXELS
#define WG (TILE * TILE / PIXELS)
#define STEP (TILE / PIXELS)  // rows between an item's pixels
// Small groups have several pixels for each item, which need registers.
#if PIXELS > 1
#define PIXELS_REGISTERS MANY_REGISTERS
#else
#define PIXELS_REGISTERS
#endif

// State of a work-item's pixels, which lie in column x of the tile at (x0, y0), STEP rows apart from row y on:
typedef struct {
  int x0, y0, x, y;
  float T[PIXELS];      // transmittance, 0 where a pixel is finished
  float4 tint[PIXELS];  // sums of weight x (red, green, blue, depth)
  float sum[PIXELS];    // sums of weights
#ifdef GEOMETRY
  float4 facing[PIXELS];        // sums of weight x normal, and the median depth
  float distortion[PIXELS];     // so far
  float m[PIXELS], mm[PIXELS];  // sums of weight x m, weight x m^2
#endif
  COUNTED(uint)
} Column;

// Blends a record into the pixels. Returns the largest transmittance left.
static inline float blend(Column* own, Record r, float near, int current, float r0) {
  const float dx = (r.place.x - ((float)own->x0 + 0.5f)) - (float)own->x;
  const float dy0 = (r.place.y - ((float)own->y0 + 0.5f)) - (float)own->y;
  float left = 0.0f;
#pragma unroll
  for (int p = 0; p < PIXELS; ++p) {
    const Meeting at = meet(r, dx, dy0 - (float)(p * STEP), near, current);
    const float full = exp2_scalar(SURFEL_LOG2_ALPHA(r, at.rho)), a = min(full, MAX_ALPHA);
    if (at.in && full >= MIN_ALPHA) {
      const float before = own->T[p], after = before * (1.0f - a);
      const bool live = after >= MIN_TRANSMITTANCE;
      own->T[p] = live ? after : 0.0f;
      if (live) {
        const float w = before * a;
        own->tint[p] += w * (float4)(r.tint.xyz, at.depth);
#ifdef GEOMETRY
        own->facing[p].xyz += w * r.normal.xyz;
        if (before > 0.5f) own->facing[p].w = at.depth;
        const float m = WARPED(near, r0, at.depth), wm = w * m;
        own->distortion[p] += w * FMA(m, FMA(m, own->sum[p], -2.0f * own->m[p]), own->mm[p]);
        own->m[p] += wm;
        own->mm[p] = FMA(wm, m, own->mm[p]);
#endif
        own->sum[p] += w;
        COUNT_ONE(own);
      }
    }
    left = max(left, own->T[p]);
  }
  return left;
}

kernel PIXELS_REGISTERS void rasterize_surfels_forward_gpu(
    global const float* records, global const uint* ids, global const uint* starts, global float* colour,
    global float* alpha, global float* depth, global float* normal, global float* median, global float* distortion,
    global float* moments, float near, int current, int width, int height, int tile_x0, int tile_y0, int tiles_x,
    int tile_count, float background_r, float background_g, float background_b COUNTER_ARGUMENTS) {
  local Record batch[WG];
  local int alive;
  const int item = get_local_id(0), tile = GROUP_ID(0);
  Column own;
  COUNT_FROM_0(&own);
  own.x0 = (tile_x0 + tile % tiles_x) * TILE, own.y0 = (tile_y0 + tile / tiles_x) * TILE;
  own.x = item % TILE, own.y = item / TILE;
#pragma unroll
  for (int p = 0; p < PIXELS; ++p) {
    own.T[p] = own.x0 + own.x < width && own.y0 + own.y + p * STEP < height ? 1.0f : 0.0f;
    own.tint[p] = own.sum[p] = 0.0f;
#ifdef GEOMETRY
    own.facing[p] = own.distortion[p] = own.m[p] = own.mm[p] = 0.0f;
#endif
  }
  const uint end = starts[tile + 1];
  const float r0 = FIRST_INVERSE(records, ids, starts[tile], end);
  int going = 1;
  for (uint first = starts[tile]; first < end && going; first += WG) {
    const uint n = min(end - first, (uint)WG);
    if (item < n) batch[item] = load_record(records + (size_t)ids[first + item] * 20);
    if (item == 0) alive = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    float left = 0.0f;
#pragma unroll
    for (int p = 0; p < PIXELS; ++p) left = max(left, own.T[p]);
    for (uint i = 0; i < n && left > 0.0f; ++i) left = blend(&own, batch[i], near, current, r0);
    if (left > 0.0f) atomic_or(&alive, 1);
    barrier(CLK_LOCAL_MEM_FENCE);
    going = alive;
    barrier(CLK_LOCAL_MEM_FENCE);  // before the next batch overwrites it
  }
#pragma unroll
  for (int p = 0; p < PIXELS; ++p) {
    const int px = own.x0 + own.x, py = own.y0 + own.y + p * STEP;
    if (px >= width || py >= height) continue;
    const size_t at = (size_t)py * width + px;
    vstore3(own.tint[p].xyz + (1.0f - own.sum[p]) * (float3)(background_r, background_g, background_b), at, colour);
    alpha[at] = own.sum[p];
    depth[at] = own.tint[p].w;
#ifdef GEOMETRY
    if (normal) vstore3(own.facing[p].xyz, at, normal);
    if (median) median[at] = own.facing[p].w;
    if (distortion) distortion[at] = own.distortion[p];
    if (moments) vstore2((float2)(own.m[p], own.mm[p]), at, moments);
#endif
  }
  ADD_COUNT(own.blended);
}
#endif
