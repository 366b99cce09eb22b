// Maps of the input views, 8 numbers a pixel side by side: the photograph (3), the drawing (3), the drawing's alpha and
// its depth. A sample of a map then reads one place in memory.
// ```
// argument    type  shape      what
// images      f32   [V,S,S,3]  photographs
// colour      f32   [n,S,S,3]  drawings of views first .. first + n - 1
// alpha       f32   [n,S,S]    of these drawings
// depth       f32   [n,S,S]    of these drawings: accumulated, sums of weight x depth
// maps        f32   [V,S,S,8]  written, of these views: photograph, colour clamped to [0,1], alpha, depth
// first_pixel int              first S S
// pixels      int              n S S
// by_alpha    int              1: the depth is divided by alpha, 0 where that is 0
// work-items  one per pixel of these views
// ```
kernel void view_maps_forward(global const float* restrict images, global const float* restrict colour,
                              global const float* restrict alpha, global const float* restrict depth,
                              global float* restrict maps, int first_pixel, int pixels, int by_alpha) {
  const int i = get_global_id(0);
  if (i >= pixels) return;
  const size_t pixel = (size_t)first_pixel + i;
  global float* to = maps + 8 * pixel;
  for (int c = 0; c < 3; ++c) {
    const float x = colour[3 * (size_t)i + c];
    to[c] = images[3 * pixel + c];
    to[3 + c] = x < 0.0f ? 0.0f : x > 1.0f ? 1.0f : x;
  }
  to[6] = alpha[i];
  to[7] = !by_alpha ? depth[i] : alpha[i] > 0.0f ? depth[i] / alpha[i] : 0.0f;
}

// Backward. Photographs have no gradient, and a colour outside of [0,1] has gradient 0.
// ```
// argument    type  shape      what
// dmaps       f32   [V,S,S,8]  gradient of maps
// dcolour     f32   [n,S,S,3]  written
// dalpha      f32   [n,S,S]    written
// ddepth      f32   [n,S,S]    written
// work-items  one per pixel of these views
// ```
kernel void view_maps_backward(global const float* restrict colour, global const float* restrict alpha,
                               global const float* restrict depth, global const float* restrict dmaps,
                               global float* restrict dcolour, global float* restrict dalpha,
                               global float* restrict ddepth, int first_pixel, int pixels, int by_alpha) {
  const int i = get_global_id(0);
  if (i >= pixels) return;
  global const float* from = dmaps + 8 * ((size_t)first_pixel + i);
  for (int c = 0; c < 3; ++c) {
    const float x = colour[3 * (size_t)i + c];
    dcolour[3 * (size_t)i + c] = x < 0.0f || x > 1.0f ? 0.0f : from[3 + c];
  }
  float a = from[6], d = from[7];
  if (by_alpha) {
    d = alpha[i] > 0.0f ? d / alpha[i] : 0.0f;
    if (alpha[i] > 0.0f) a -= d * depth[i] / alpha[i];
  }
  dalpha[i] = a;
  ddepth[i] = d;
}
