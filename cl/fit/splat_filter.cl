// The 3D filter of Mip-Splatting (Yu et al. 2024): Gaussians whose covariances get v on their diagonals and whose
// opacities keep their light, so that none is finer than what the pictures can show.
//   scale = sqrt(s^2 + v)      opacity = o c, c = product over the axes of s / sqrt(s^2 + v)

// Each Gaussian's v = (0.2 / nu)^2, nu being the largest focal length over depth of the cameras that see it: pixels per
// unit of length.
// ```
// argument    type   shape   what
// means       f32    [K,3]   in the units of the cameras
// views       f32    [V,32]  cameras as in cl/render/project.cl
// variances   f32    [K]     written: v; 0 where no camera sees the Gaussian's middle
// work-items  one per Gaussian
// ```
// A camera sees what is beyond its near plane and at most 15 % of the picture's size beside the picture.
kernel void splat_filter_variances(global const float* restrict means, global const float* restrict views,
                                   global float* restrict variances, int K, int V) {
  const int k = get_global_id(0);
  if (k >= K) return;
  const float3 mean = vload3(k, means);
  float nu = 0.0f;
  for (int v = 0; v < V; ++v) {
    global const float* camera = views + (size_t)v * 32;
    const float3 d = (mean - vload3(3, camera)) - vload3(4, camera);
    const float z = dot(vload3(2, camera), d), fx = camera[15], fy = camera[16];
    const float half_width = fx * camera[19] / 1.3f, half_height = fy * camera[20] / 1.3f;
    const float u = fx * dot(vload3(0, camera), d) / z + camera[17] - half_width;
    const float w = fy * dot(vload3(1, camera), d) / z + camera[18] - half_height;
    if (z > camera[21] && fabs(u) <= 1.3f * half_width && fabs(w) <= 1.3f * half_height) nu = max(nu, max(fx, fy) / z);
  }
  variances[k] = nu > 0.0f ? (0.2f / nu) * (0.2f / nu) : 0.0f;
}

// ```
// argument    type   shape  what
// variances   f32    [K]    v
// scales      f32    [K,3]  in: s, above 0; out: filtered
// opacities   f32    [K]    in: o; out: filtered
// work-items  one per Gaussian
// ```
kernel void splat_filter_forward(global const float* restrict variances, global float* restrict scales,
                                 global float* restrict opacities, int K) {
  const int k = get_global_id(0);
  if (k >= K) return;
  const float3 s = vload3(k, scales), filtered = sqrt(s * s + variances[k]), c = s / filtered;
  vstore3(filtered, k, scales);
  opacities[k] *= c.x * c.y * c.z;
}

// Gradients by what is filtered become those by what is not, in place.
// ```
// argument    type   shape  what
// variances   f32    [K]    v
// log_scales  f32    [K,3]  logarithms of s
// opacities   f32    [K]    filtered
// dscales     f32    [K,3]  in: by filtered scales; out: by s
// dopacities  f32    [K]    in: by filtered opacities; out: by o
// work-items  one per Gaussian
// ```
kernel void splat_filter_backward(global const float* restrict variances, global const float* restrict log_scales,
                                  global const float* restrict opacities, global float* restrict dscales,
                                  global float* restrict dopacities, int K) {
  const int k = get_global_id(0);
  if (k >= K) return;
  const float v = variances[k], by_opacity = dopacities[k];
  const float3 s = exp(vload3(k, log_scales)), filtered2 = s * s + v, c = s / sqrt(filtered2);
  // d log c / ds = v / (s (s^2 + v)) along each axis.
  vstore3(vload3(k, dscales) * c + by_opacity * opacities[k] * v / (s * filtered2), k, dscales);
  dopacities[k] = by_opacity * (c.x * c.y * c.z);
}
