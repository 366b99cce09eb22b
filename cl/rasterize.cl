// Blending, near to far, as the original rasteriser defines it: alpha = min(0.99, o exp(power)), nothing below 1/255, and a
// pixel ends before the Gaussian that would bring its transmittance under 1e-4.
//   records [K,12] as project.cl writes them; ids [N] Gaussians tile by tile, near to far; starts [tiles + 1].
//   colour [H,W,3] = sum of weight x colour + what is left x background; alpha [H,W] = sum of weights;
//   depth [H,W] = sum of weight x camera z, not divided by alpha. Tiles are 16 x 16 pixels, tiles_x of them in a row.
// cpu: a work-item owns ROWS rows of a tile, a float16 each. gpu: a work-group of 16 x 16 / PIXELS items owns a tile, each
// item PIXELS rows of one column, and records pass through local memory.
#include "common.clh"

#define TILE 16
#define MAX_ALPHA 0.99f
#define MIN_ALPHA (1.0f / 255.0f)
#define MIN_TRANSMITTANCE 1e-4f

// 2^x for x <= 0, a few units in the last place off (what is under 2^-126 does not matter here): a polynomial on [-0.5, 0.5]
// and the exponent's bits.
#define EXP2(NAME, FLOAT, INT, CONVERT, AS)                                                                       \
  static inline FLOAT NAME(FLOAT x) {                                                                             \
    x = max(x, -126.0f);                                                                                          \
    const FLOAT whole = rint(x), f = x - whole;                                                                   \
    const FLOAT p =                                                                                               \
        FMA(FMA(FMA(FMA(FMA((FLOAT)(0.00132764714f), f, (FLOAT)(0.00967554133f)), f, (FLOAT)(0.0555071328f)), f,  \
                    (FLOAT)(0.240221197f)),                                                                       \
                f, (FLOAT)(0.693146967f)),                                                                        \
            f, (FLOAT)(1.00000007f));                                                                             \
    return AS(AS##_bits(p) + (CONVERT(whole) << 23));                                                             \
  }
#define as_float_bits as_int
#define as_float16_bits as_int16
EXP2(exp2_scalar, float, int, convert_int, as_float)
EXP2(exp2_rows, float16, int16, convert_int16, as_float16)

#ifdef ROWS
kernel void rasterize_cpu(global const float* records, global const uint* ids,
                          global const uint* starts, global float* colour, global float* alpha, global float* depth,
                          int width, int height, int tiles_x, int tile_count, float background_r, float background_g,
                          float background_b) {
  const int strip = get_global_id(0), tile = strip / (TILE / ROWS);
  if (tile >= tile_count) return;
  const int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE + strip % (TILE / ROWS) * ROWS;
  if (y0 >= height) return;
  const float16 lane = (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  // A finished pixel has transmittance 0.
  float16 T[ROWS], red[ROWS], green[ROWS], blue[ROWS], sum[ROWS], far[ROWS];
  for (int r = 0; r < ROWS; ++r) {
    T[r] = y0 + r < height ? 1.0f : 0.0f;
    red[r] = green[r] = blue[r] = sum[r] = far[r] = 0.0f;
  }
  const uint end = starts[tile + 1];
  for (uint i = starts[tile]; i < end; ++i) {
    const uint id = ids[i];
    const float4 place = vload4(0, records + (size_t)id * 12);
    const float dy0 = place.y - ((float)y0 + 0.5f);
    if (dy0 < -place.z || dy0 > (ROWS - 1) + place.z) continue;
    const float4 form = vload4(1, records + (size_t)id * 12), tint = vload4(2, records + (size_t)id * 12);
    const float16 dx = (place.x - ((float)x0 + 0.5f)) - lane;
    const float16 slope = form.y * dx, base = FMA(form.z * dx, dx, (float16)(form.x));
    float16 left = 0.0f;
#pragma unroll
    for (int r = 0; r < ROWS; ++r) {
      const float16 t = (dy0 - (float)r) - slope;
      const float16 a = min(exp2_rows(FMA(form.w * t, t, base)), MAX_ALPHA);
      // Transmittance as a product: T - T a would round across the threshold.
      const float16 after = T[r] * (1.0f - a);
      const int16 skip = a < MIN_ALPHA, live = after >= MIN_TRANSMITTANCE;
      const float16 w = select((float16)(0.0f), T[r] * a, live & ~skip);
      T[r] = select(select((float16)(0.0f), after, live), T[r], skip);
      red[r] = FMA(w, (float16)(tint.x), red[r]);
      green[r] = FMA(w, (float16)(tint.y), green[r]);
      blue[r] = FMA(w, (float16)(tint.z), blue[r]);
      far[r] = FMA(w, (float16)(place.w), far[r]);
      sum[r] += w;
      left = max(left, T[r]);
    }
    if (!any(left > 0.0f)) break;
  }
  for (int r = 0; r < ROWS && y0 + r < height; ++r) {
    const size_t row = (size_t)(y0 + r) * width + x0;
    const float16 rest = 1.0f - sum[r];
    float out[5][TILE];
    vstore16(FMA(rest, (float16)(background_r), red[r]), 0, out[0]);
    vstore16(FMA(rest, (float16)(background_g), green[r]), 0, out[1]);
    vstore16(FMA(rest, (float16)(background_b), blue[r]), 0, out[2]);
    vstore16(sum[r], 0, out[3]);
    vstore16(far[r], 0, out[4]);
    for (int x = 0; x < TILE && x0 + x < width; ++x) {
      for (int c = 0; c < 3; ++c) colour[3 * (row + x) + c] = out[c][x];
      alpha[row + x] = out[3][x];
      depth[row + x] = out[4][x];
    }
  }
}
#endif

#ifdef PIXELS
#define WG (TILE * TILE / PIXELS)
#define STEP (TILE / PIXELS)  // rows between an item's pixels

kernel void rasterize_gpu(global const float* records, global const uint* ids,
                          global const uint* starts, global float* colour, global float* alpha, global float* depth,
                          int width, int height, int tiles_x, int tile_count, float background_r, float background_g,
                          float background_b) {
  local float4 place[WG], form[WG], tint[WG];
  local int alive;
  const int item = get_local_id(0), tile = get_group_id(0);
  const int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE, x = item % TILE, y = item / TILE;
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
      const float dx = (at.x - ((float)x0 + 0.5f)) - (float)x, slope = f.y * dx, base = FMA(f.z * dx, dx, f.x);
      const float dy0 = (at.y - ((float)y0 + 0.5f)) - (float)y;
      left = 0.0f;
      for (int p = 0; p < PIXELS; ++p) {
        const float t = (dy0 - (float)(p * STEP)) - slope;
        const float a = min(exp2_scalar(FMA(f.w * t, t, base)), MAX_ALPHA);
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
