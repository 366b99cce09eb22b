// What a training wants of surfels' surface, as LaRa and 2DGS have it: that the weights along a ray lie close together,
// and that normals are those of the surface that the depths span. With means over pixels,
//   distortion_weight mean(distortion) + normal_weight mean(alpha (1 - normal . depth_normal)),
// where that alpha counts as constant.
// ```
// argument       type   shape     what
// normal         f32    [N,3]     of the surfels, as lara_maps.cl has both
// depth_normal   f32    [N,3]
// alpha          f32    [N]
// distortion     f32    [N]
// dnormal        f32    [N,3]     written: the loss times gradient_scale, by these
// ddepth_normal  f32    [N,3]     written
// ddistortion    f32    [N]       written
// sums           f32    [blocks]  written: the loss of blocks of GROUP * EACH pixels
// by_distortion  float            distortion_weight / N, and
// by_normal      float            normal_weight / N
// work-items     groups of GROUP, a block each
// define GROUP   64               work-items of a group, a power of two
// define EACH    32               pixels of each of them
// ```
#include "common.clh"

#ifndef GROUP
#define GROUP 64
#endif
#ifndef EACH
#define EACH 32
#endif

kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void surface_loss(
    global const float* restrict normal, global const float* restrict depth_normal, global const float* restrict alpha,
    global const float* restrict distortion, global float* restrict dnormal, global float* restrict ddepth_normal,
    global float* restrict ddistortion, global float* restrict sums, int pixels, float by_distortion, float by_normal,
    float gradient_scale) {
  local float part[GROUP];
  const int block = GROUP_ID(0), item = get_local_id(0), first = block * (GROUP * EACH);
  const int last = min(pixels, first + GROUP * EACH);
  float sum = 0.0f;
  for (int i = first + item; i < last; i += GROUP) {
    const float3 n = vload3(i, normal), m = vload3(i, depth_normal);
    const float of_normal = by_normal * alpha[i];
    sum += by_distortion * distortion[i] + of_normal * (1.0f - dot(n, m));
    vstore3(-gradient_scale * of_normal * m, i, dnormal);
    vstore3(-gradient_scale * of_normal * n, i, ddepth_normal);
    ddistortion[i] = gradient_scale * by_distortion;
  }
  part[item] = sum;
  for (int step = GROUP / 2; step > 0; step /= 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item < step) part[item] += part[item + step];
  }
  if (item == 0) sums[block] = part[0];
}

// Their sum, by Kahan's summation.
// ```
// argument    type  shape     what
// sums        f32   [blocks]  from surface_loss
// value       f32   [..]      the first number is added to
// work-items  one
// ```
kernel void surface_loss_value(global const float* restrict sums, global float* restrict value, int blocks) {
  float sum = 0.0f, lost = 0.0f;
  for (int b = 0; b < blocks; ++b) {
    const float add = sums[b] - lost, next = sum + add;
    lost = (next - sum) - add;
    sum = next;
  }
  value[0] += sum;
}
