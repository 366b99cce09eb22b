// Blending, near to far, as the original rasteriser defines it: alpha = min(0.99, o exp(power)), nothing below 1/255,
// and a pixel ends before the Gaussian that would bring its transmittance under 1e-4.
// ```
// argument              type   shape      what
// records               f32    [V,12]     as project.cl writes them
// ids                   u32    [N]        which records the tiles see, tile by tile, near to far
// starts                u32    [tiles+1]  where each tile's run of ids begins
// colour                f32    [H,W,3]    written: sum of weight x colour, + what is left x background
// alpha                 f32    [H,W]      written: sum of weights
// depth                 f32    [H,W]      written: sum of weight x camera z, not divided by alpha
// width, height         int               of the picture, pixels
// tile_x0, tile_y0      int               the first tile of the part of the picture that is drawn; tiles are 16 x 16
//                                         pixels
// tiles_x, tile_count   int               tiles in a row of the part, and in all
// background_r, _g, _b  float             colour behind the scene
// define BATCH                            cpu flavour: Gaussians that are taken at a time, a multiple of 16
// define PIXELS                           gpu flavour: pixels of a work-item, every (16 / PIXELS)th row of one column
// work-items            cpu: one per tile, a float16 being a block of 4 x 4 pixels; gpu: groups of 256 / PIXELS, one
//                       per tile, with records going through local memory
// ```
#include "rasterize.clh"

#ifdef BATCH
// A tile's Gaussians come in batches. First each is held against the tile's 16 blocks, 16 Gaussians at a time; then it
// is blended into those blocks that it can reach and that have unfinished pixels.
#define BLOCKS 16

// masks [BATCH]: the blocks that each Gaussian can reach (bit 4 row + column). A block's pixel centres lie within 1.5
// of its middle, so dx and t lie within 1.5 and 1.5 (1 + |k|) of what they are there. Where even the nearest of these
// leave log2 alpha < log2(1/255), the block is left out, and nothing is lost. What is more than 1.5 is for rounding.
// (rasterize.clh's least_fall leaves out a few more blocks, but costs more than it saves here.)
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

kernel void rasterize_forward_cpu(global const float* records, global const uint* ids, global const uint* starts,
                                  global float* colour, global float* alpha, global float* depth, int width, int height,
                                  int tile_x0, int tile_y0, int tiles_x, int tile_count, float background_r,
                                  float background_g, float background_b) {
  const int tile = get_global_id(0);
  if (tile >= tile_count) return;
  const int x0 = (tile_x0 + tile % tiles_x) * TILE, y0 = (tile_y0 + tile / tiles_x) * TILE;
  const float16 lane_x = (float16)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3);
  const float16 lane_y = (float16)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
  const float corner_x = (float)x0 + 0.5f, corner_y = (float)y0 + 0.5f;
  // A finished pixel has transmittance 0.
  float16 column[BLOCKS], row[BLOCKS];  // of each block's pixels
  float16 T[BLOCKS], red[BLOCKS], green[BLOCKS], blue[BLOCKS], sum[BLOCKS], far[BLOCKS];
  uint alive = 0;  // blocks
  for (int b = 0; b < BLOCKS; ++b) {
    column[b] = lane_x + (float)(4 * (b & 3));
    row[b] = lane_y + (float)(4 * (b >> 2));
    T[b] =
        select((float16)(0.0f), (float16)(1.0f), (column[b] < (float)(width - x0)) & (row[b] < (float)(height - y0)));
    red[b] = green[b] = blue[b] = sum[b] = far[b] = 0.0f;
    if (x0 + 4 * (b & 3) < width && y0 + 4 * (b >> 2) < height) alive |= 1u << b;
  }
  const uint end = starts[tile + 1];
  for (uint first = starts[tile]; first < end && alive; first += BATCH) {
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
    for (uint j = 0; j < n; ++j) {
      const float* r = batch + 12 * j;
      const float4 form = (float4)(r[4], r[5], r[6], r[7]);
      const float u = r[0] - corner_x, v = r[1] - corner_y;
      for (uint rest = masks[j] & alive; rest; rest &= rest - 1) {
        const uint b = 31 - clz(rest & -rest);
        const float16 dx = u - column[b], dy = v - row[b];
        const float16 a = min(exp2_rows(LOG2_ALPHA(form, dx, SHEARED(form, dx, dy))), MAX_ALPHA);
        // The transmittance is a product: T - T a might round across the threshold.
        const float16 before = T[b], after = before * (1.0f - a);
        const int16 skip = a < MIN_ALPHA, live = after >= MIN_TRANSMITTANCE;
        const float16 w = select((float16)(0.0f), before * a, live & ~skip);
        T[b] = select(select((float16)(0.0f), after, live), before, skip);
        red[b] = FMA(w, (float16)(r[8]), red[b]);
        green[b] = FMA(w, (float16)(r[9]), green[b]);
        blue[b] = FMA(w, (float16)(r[10]), blue[b]);
        far[b] = FMA(w, (float16)(r[3]), far[b]);
        sum[b] += w;
      }
    }
    for (uint b = 0; b < BLOCKS; ++b)
      if (largest(T[b]) == 0.0f) alive &= ~(1u << b);
  }
  for (int b = 0; b < BLOCKS; ++b) {
    const int x = x0 + 4 * (b & 3), y = y0 + 4 * (b >> 2);
    if (x >= width || y >= height) continue;
    const float16 left = 1.0f - sum[b];
    const float16 r = FMA(left, (float16)(background_r), red[b]), g = FMA(left, (float16)(background_g), green[b]);
    const float16 bl = FMA(left, (float16)(background_b), blue[b]);
    write_row(r.s0123, g.s0123, bl.s0123, sum[b].s0123, far[b].s0123, colour, alpha, depth, width, height, x, y);
    write_row(r.s4567, g.s4567, bl.s4567, sum[b].s4567, far[b].s4567, colour, alpha, depth, width, height, x, y + 1);
    write_row(r.s89ab, g.s89ab, bl.s89ab, sum[b].s89ab, far[b].s89ab, colour, alpha, depth, width, height, x, y + 2);
    write_row(r.scdef, g.scdef, bl.scdef, sum[b].scdef, far[b].scdef, colour, alpha, depth, width, height, x, y + 3);
  }
}
#endif

#ifdef PIXELS
#define WG (TILE * TILE / PIXELS)
#define STEP (TILE / PIXELS)  // rows between an item's pixels

kernel void rasterize_forward_gpu(global const float* records, global const uint* ids, global const uint* starts,
                                  global float* colour, global float* alpha, global float* depth, int width, int height,
                                  int tile_x0, int tile_y0, int tiles_x, int tile_count, float background_r,
                                  float background_g, float background_b) {
  local float4 place[WG], form[WG], tint[WG];
  local int alive;
  const int item = get_local_id(0), tile = get_group_id(0);
  const int x0 = (tile_x0 + tile % tiles_x) * TILE, y0 = (tile_y0 + tile / tiles_x) * TILE;
  const int x = item % TILE, y = item / TILE;
  float T[PIXELS], red[PIXELS], green[PIXELS], blue[PIXELS], sum[PIXELS], far[PIXELS];
  for (int p = 0; p < PIXELS; ++p) {
    T[p] = x0 + x < width && y0 + y + p * STEP < height ? 1.0f : 0.0f;
    red[p] = green[p] = blue[p] = sum[p] = far[p] = 0.0f;
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
    for (int p = 0; p < PIXELS; ++p) left = max(left, T[p]);
    for (uint i = 0; i < n && left > 0.0f; ++i) {
      const float4 at = place[i], f = form[i], c = tint[i];
      const float dx = (at.x - ((float)x0 + 0.5f)) - (float)x;
      const float dy0 = (at.y - ((float)y0 + 0.5f)) - (float)y;
      left = 0.0f;
      for (int p = 0; p < PIXELS; ++p) {
        const float t = SHEARED(f, dx, dy0 - (float)(p * STEP));
        const float a = min(exp2_scalar(LOG2_ALPHA(f, dx, t)), MAX_ALPHA);
        if (a >= MIN_ALPHA) {
          const float after = T[p] * (1.0f - a);
          const float w = after >= MIN_TRANSMITTANCE ? T[p] * a : 0.0f;
          T[p] = after >= MIN_TRANSMITTANCE ? after : 0.0f;
          red[p] = FMA(w, c.x, red[p]);
          green[p] = FMA(w, c.y, green[p]);
          blue[p] = FMA(w, c.z, blue[p]);
          far[p] = FMA(w, at.w, far[p]);
          sum[p] += w;
        }
        left = max(left, T[p]);
      }
    }
    if (left > 0.0f) atomic_or(&alive, 1);
    barrier(CLK_LOCAL_MEM_FENCE);
    going = alive;
    barrier(CLK_LOCAL_MEM_FENCE);  // before the next batch overwrites it
  }
  for (int p = 0; p < PIXELS; ++p) {
    const int px = x0 + x, py = y0 + y + p * STEP;
    if (px >= width || py >= height) continue;
    const size_t at = (size_t)py * width + px;
    const float rest = 1.0f - sum[p];
    colour[3 * at] = FMA(rest, background_r, red[p]);
    colour[3 * at + 1] = FMA(rest, background_g, green[p]);
    colour[3 * at + 2] = FMA(rest, background_b, blue[p]);
    alpha[at] = sum[p];
    depth[at] = far[p];
  }
}
#endif
