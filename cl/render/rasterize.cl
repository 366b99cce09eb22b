// Blending, near to far, as the original rasteriser defines it: alpha = min(0.99, o exp(power)), nothing below 1/255,
// and a pixel ends before the Gaussian that would bring its transmittance under 1e-4.
// ```
// argument              type   shape      what
// records               f32    [V,12]     as project.cl writes them
// ids                   u32    [N]        the records that the tiles see, tile by tile, near to far
// starts                u32    [tiles+1]  where each tile's run of ids begins
// colour                f32    [H,W,3]    written: sum of weight x colour, + remaining transmittance x background
// alpha                 f32    [H,W]      written: sum of weights
// depth                 f32    [H,W]      written: sum of weight x camera z, not divided by alpha
// width, height         int               of the picture, pixels
// tile_x0, tile_y0      int               the first tile of the part of the picture that is drawn; tiles are 16 x 16
//                                         pixels
// tiles_x, tile_count   int               tiles in a row of the part, and in all
// background_r, _g, _b  float             colour behind the scene
// define BATCH                            cpu flavour: Gaussians that are processed at a time, a multiple of 16
// define PIXELS                           gpu flavour: pixels of a work-item, every (16 / PIXELS)th row of one column
// work-items            cpu: one per tile, a float16 being a block of 4 x 4 pixels; gpu: groups of 256 / PIXELS, one
//                       per tile, with records going through local memory
// ```
#include "many_registers.clh"
#include "rasterize.clh"

#ifdef BATCH
// A tile's Gaussians come in batches. Each is first tested against the tile's 16 blocks, 16 Gaussians at a time; then
// it is blended into the blocks that it can reach and that have unfinished pixels.
#define BLOCKS 16

// masks [BATCH]: the blocks that each Gaussian can reach (bit 4 row + column). A block's pixel centres lie within 1.5
// of its middle, so dx and t differ from their values there by at most 1.5 and 1.5 (1 + |k|). If log2 alpha <
// log2(1/255) even at the nearest of these, the block is skipped, without any loss. The excess over 1.5 is a margin for
// rounding. (rasterize.clh's least_fall skips a few more blocks, but costs more than it saves here.)
static inline void reach_blocks(const float* records, uint n, float corner_x, float corner_y, uint* masks) {
  for (uint first = 0; first < n; first += 16) {
    float part[7][16];
    for (uint j = 0; j < 16; ++j) {
      const float* r = records + 12 * min(first + j, n - 1);
      part[0][j] = r[0], part[1][j] = r[1], part[2][j] = r[2];
      part[3][j] = r[4], part[4][j] = r[5], part[5][j] = r[6], part[6][j] = r[7];
    }
    const float16 u = vload16(0, part[0]) - (corner_x + 1.5f), v = vload16(0, part[1]) - (corner_y + 1.5f);
    const float16 reach_y = vload16(0, part[2]) + 1.5f, room = vload16(0, part[3]) + (LOG2_255 + 1e-3f);
    const float16 k = vload16(0, part[4]), qx = vload16(0, part[5]), qy = vload16(0, part[6]);
    const float16 half_t = FMA(fabs(k), (float16)(1.501f), (float16)(1.501f));
    uint16 mask = 0;
#pragma unroll
    for (int column = 0; column < 4; ++column) {
      const float16 dx = u - (float)(4 * column), t = v - k * dx, near_x = max(fabs(dx) - 1.501f, 0.0f);
      const float16 left = FMA(qx * near_x, near_x, room);
#pragma unroll
      for (int row = 0; row < 4; ++row) {
        const float16 near_t = max(fabs(t - (float)(4 * row)) - half_t, 0.0f);
        const int16 hit = (fabs(v - (float)(4 * row)) <= reach_y) & (FMA(qy * near_t, near_t, left) >= 0.0f);
        mask |= as_uint16(hit) & (1u << (4 * row + column));
      }
    }
    vstore16(mask, 0, masks + first);
  }
}

// Writes four pixels side by side, as far as they are in the picture.
static inline void write_row(float4 r, float4 g, float4 b, float4 a, float4 z, global float* colour,
                             global float* alpha, global float* depth, int width, int height, int x, int y) {
  if (y >= height) return;
  const size_t pixel = (size_t)y * width + x;
  if (x + 4 <= width) {
    vstore8((float8)(r.x, g.x, b.x, r.y, g.y, b.y, r.z, g.z), 0, colour + 3 * pixel);
    vstore4((float4)(b.z, r.w, g.w, b.w), 0, colour + 3 * pixel + 8);
    vstore4(a, 0, alpha + pixel);
    vstore4(z, 0, depth + pixel);
    return;
  }
  const float rest[5][4] = {
      {r.x, r.y, r.z, r.w}, {g.x, g.y, g.z, g.w}, {b.x, b.y, b.z, b.w}, {a.x, a.y, a.z, a.w}, {z.x, z.y, z.z, z.w}};
  for (int i = 0; x + i < width; ++i) {
    for (int c = 0; c < 3; ++c) colour[3 * (pixel + i) + c] = rest[c][i];
    alpha[pixel + i] = rest[3][i];
    depth[pixel + i] = rest[4][i];
  }
}

// State of each of a tile's blocks:
typedef struct {
  float16 column[BLOCKS], row[BLOCKS];                            // pixels' places in the tile
  float16 T[BLOCKS];                                              // transmittance, 0 where a pixel is finished
  float16 red[BLOCKS], green[BLOCKS], blue[BLOCKS], far[BLOCKS];  // sums of weight x colour, weight x depth
  float16 sum[BLOCKS];                                            // sums of weights
  uint alive;                                                     // a bit for each block that has unfinished pixels
  COUNTED(int16)
} Tile;

static inline void start_tile(Tile* tile, int x0, int y0, int width, int height) {
  const float16 lane_x = (float16)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3);
  const float16 lane_y = (float16)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
  tile->alive = 0;
  COUNT_FROM_0(tile);
  for (int b = 0; b < BLOCKS; ++b) {
    const float16 column = lane_x + (float)(4 * (b & 3)), row = lane_y + (float)(4 * (b >> 2));
    tile->column[b] = column;
    tile->row[b] = row;
    tile->T[b] =
        select((float16)(0.0f), (float16)(1.0f), (column < (float)(width - x0)) & (row < (float)(height - y0)));
    tile->red[b] = tile->green[b] = tile->blue[b] = tile->sum[b] = tile->far[b] = 0.0f;
    if (x0 + 4 * (b & 3) < width && y0 + 4 * (b >> 2) < height) tile->alive |= 1u << b;
  }
}

// Blends a record into the blocks of `rest`.
static inline void blend(Tile* tile, const float* r, float corner_x, float corner_y, uint rest) {
  const float4 form = (float4)(r[4], r[5], r[6], r[7]);
  const float u = r[0] - corner_x, v = r[1] - corner_y;
  for (; rest; rest &= rest - 1) {
    const uint b = 31 - clz(rest & -rest);
    const float16 dx = u - tile->column[b], dy = v - tile->row[b];
    const float16 a = min(exp2_rows(LOG2_ALPHA(form, dx, SHEARED(form, dx, dy))), MAX_ALPHA);
    // The transmittance is a product: T - T a might round across the threshold.
    const float16 before = tile->T[b], after = before * (1.0f - a);
    const int16 skip = a < MIN_ALPHA, live = after >= MIN_TRANSMITTANCE;
    const float16 w = select((float16)(0.0f), before * a, live & ~skip);
    COUNT_ROWS(tile, live & ~skip);
    tile->T[b] = select(select((float16)(0.0f), after, live), before, skip);
    tile->red[b] = FMA(w, (float16)(r[8]), tile->red[b]);
    tile->green[b] = FMA(w, (float16)(r[9]), tile->green[b]);
    tile->blue[b] = FMA(w, (float16)(r[10]), tile->blue[b]);
    tile->far[b] = FMA(w, (float16)(r[3]), tile->far[b]);
    tile->sum[b] += w;
  }
}

// Writes block b, whose first pixel is (x, y), over the background.
static inline void write_block(const Tile* tile, int b, float3 background, global float* colour, global float* alpha,
                               global float* depth, int width, int height, int x, int y) {
  const float16 sum = tile->sum[b], far = tile->far[b], left = 1.0f - sum;
  const float16 r = FMA(left, (float16)(background.x), tile->red[b]);
  const float16 g = FMA(left, (float16)(background.y), tile->green[b]);
  const float16 bl = FMA(left, (float16)(background.z), tile->blue[b]);
  write_row(r.s0123, g.s0123, bl.s0123, sum.s0123, far.s0123, colour, alpha, depth, width, height, x, y);
  write_row(r.s4567, g.s4567, bl.s4567, sum.s4567, far.s4567, colour, alpha, depth, width, height, x, y + 1);
  write_row(r.s89ab, g.s89ab, bl.s89ab, sum.s89ab, far.s89ab, colour, alpha, depth, width, height, x, y + 2);
  write_row(r.scdef, g.scdef, bl.scdef, sum.scdef, far.scdef, colour, alpha, depth, width, height, x, y + 3);
}

kernel void rasterize_forward_cpu(global const float* records, global const uint* ids, global const uint* starts,
                                  global float* colour, global float* alpha, global float* depth, int width, int height,
                                  int tile_x0, int tile_y0, int tiles_x, int tile_count, float background_r,
                                  float background_g, float background_b COUNTER_ARGUMENTS) {
  const int at = get_global_id(0);
  if (at >= tile_count) return;
  const int x0 = (tile_x0 + at % tiles_x) * TILE, y0 = (tile_y0 + at / tiles_x) * TILE;
  const float corner_x = (float)x0 + 0.5f, corner_y = (float)y0 + 0.5f;
  Tile tile;
  start_tile(&tile, x0, y0, width, height);
  const uint end = starts[at + 1];
  for (uint first = starts[at]; first < end && tile.alive; first += BATCH) {
    const uint n = min(end - first, (uint)BATCH);
    float batch[12 * BATCH];
    uint masks[BATCH];
    for (uint j = 0; j < n; ++j) {
      global const float* r = records + (size_t)ids[first + j] * 12;
      vstore4(vload4(0, r), 0, batch + 12 * j);
      vstore4(vload4(1, r), 1, batch + 12 * j);
      vstore4(vload4(2, r), 2, batch + 12 * j);
    }
    reach_blocks(batch, n, corner_x, corner_y, masks);
    for (uint j = 0; j < n; ++j) blend(&tile, batch + 12 * j, corner_x, corner_y, masks[j] & tile.alive);
    for (uint b = 0; b < BLOCKS; ++b)
      if (largest(tile.T[b]) == 0.0f) tile.alive &= ~(1u << b);
  }
  const float3 background = (float3)(background_r, background_g, background_b);
  for (int b = 0; b < BLOCKS; ++b) {
    const int x = x0 + 4 * (b & 3), y = y0 + 4 * (b >> 2);
    if (x < width && y < height) write_block(&tile, b, background, colour, alpha, depth, width, height, x, y);
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
  float T[PIXELS];                                              // transmittance, 0 where a pixel is finished
  float red[PIXELS], green[PIXELS], blue[PIXELS], far[PIXELS];  // sums of weight x colour, weight x depth
  float sum[PIXELS];                                            // sums of weights
  COUNTED(uint)
} Column;

// Blends a record (at, f and c are its twelve numbers) into the pixels. Returns the largest transmittance left.
static inline float blend(Column* own, float4 at, float4 f, float4 c) {
  const float dx = (at.x - ((float)own->x0 + 0.5f)) - (float)own->x;
  const float dy0 = (at.y - ((float)own->y0 + 0.5f)) - (float)own->y;
  float left = 0.0f;
#pragma unroll
  for (int p = 0; p < PIXELS; ++p) {
    const float t = SHEARED(f, dx, dy0 - (float)(p * STEP));
    const float a = min(exp2_scalar(LOG2_ALPHA(f, dx, t)), MAX_ALPHA);
    if (a >= MIN_ALPHA) {
      const float after = own->T[p] * (1.0f - a);
      const float w = after >= MIN_TRANSMITTANCE ? own->T[p] * a : 0.0f;
      own->T[p] = after >= MIN_TRANSMITTANCE ? after : 0.0f;
      own->red[p] = FMA(w, c.x, own->red[p]);
      own->green[p] = FMA(w, c.y, own->green[p]);
      own->blue[p] = FMA(w, c.z, own->blue[p]);
      own->far[p] = FMA(w, at.w, own->far[p]);
      own->sum[p] += w;
      if (after >= MIN_TRANSMITTANCE) COUNT_ONE(own);
    }
    left = max(left, own->T[p]);
  }
  return left;
}

kernel PIXELS_REGISTERS void rasterize_forward_gpu(global const float* records, global const uint* ids,
                                                   global const uint* starts, global float* colour, global float* alpha,
                                                   global float* depth, int width, int height, int tile_x0, int tile_y0,
                                                   int tiles_x, int tile_count, float background_r, float background_g,
                                                   float background_b COUNTER_ARGUMENTS) {
  local float4 place[WG], form[WG], tint[WG];
  local int alive;
  const int item = get_local_id(0), tile = GROUP_ID(0);
  Column own;
  COUNT_FROM_0(&own);
  own.x0 = (tile_x0 + tile % tiles_x) * TILE, own.y0 = (tile_y0 + tile / tiles_x) * TILE;
  own.x = item % TILE, own.y = item / TILE;
#pragma unroll
  for (int p = 0; p < PIXELS; ++p) {
    own.T[p] = own.x0 + own.x < width && own.y0 + own.y + p * STEP < height ? 1.0f : 0.0f;
    own.red[p] = own.green[p] = own.blue[p] = own.sum[p] = own.far[p] = 0.0f;
  }
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
    if (item == 0) alive = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    float left = 0.0f;
#pragma unroll
    for (int p = 0; p < PIXELS; ++p) left = max(left, own.T[p]);
    for (uint i = 0; i < n && left > 0.0f; ++i) left = blend(&own, place[i], form[i], tint[i]);
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
    const float rest = 1.0f - own.sum[p];
    colour[3 * at] = FMA(rest, background_r, own.red[p]);
    colour[3 * at + 1] = FMA(rest, background_g, own.green[p]);
    colour[3 * at + 2] = FMA(rest, background_b, own.blue[p]);
    alpha[at] = own.sum[p];
    depth[at] = own.far[p];
  }
  ADD_COUNT(own.blended);
}
#endif
