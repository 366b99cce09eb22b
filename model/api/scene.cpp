#include "model/api/scene.h"

#include <algorithm>
#include <cmath>

#include "model/io/archive/selection_file.h"
#include "model/io/scene/scene_format.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

// Replaces `to`'s `each` values of each Gaussian by `from`, unless that is null. `good` checks a value; `what`
// describes it in the error.
template <class Good>
void replace(std::vector<float>& to, const float* from, size_t count, size_t each, const char* name, const Good& good,
             const char* what) {
  if (!from) return;
  for (size_t i = 0; i < count * each; ++i)
    if (!good(from[i]))
      fail(Status::input, "arrays.{}: {} in value {} of Gaussian {}: {} expected", name, from[i], i % each, i / each,
           what);
  to.assign(from, from + count * each);
}

void check_rotations(const float* quats, size_t count) {
  for (size_t k = 0; quats && k < count; ++k) {
    const float* q = quats + 4 * k;
    const float length2 = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    if (!(length2 > 0) || !std::isfinite(length2))
      fail(Status::input, "arrays.rotations: Gaussian {} has {} {} {} {}, which is no rotation", k, q[0], q[1], q[2],
           q[3]);
  }
}

// Converts a caller's three scales of each surfel to two, leaving out the third, which is 0.
std::vector<float> tangent_scales(const float* scales, size_t count) {
  std::vector<float> out;
  out.reserve(2 * count);
  for (size_t k = 0; k < count; ++k) {
    const float* s = scales + 3 * k;
    if (s[2] != 0)
      fail(Status::input, "arrays.scales: {} in value 2 of Gaussian {}: 0 expected, since the scene's are surfels",
           s[2], k);
    out.insert(out.end(), {s[0], s[1]});
  }
  return out;
}

// The caller's detail; none if unknown.
std::optional<Detail> detail_of(const vsplat_scene_info& info) {
  const double pixel = info.detail_pixel;
  if (!(pixel >= 0) || (pixel > 0 && !std::isnormal(static_cast<float>(pixel))))
    fail(Status::input, "info.detail_pixel is {}: 0, or the width of a pixel, expected", pixel);
  if (pixel == 0) return std::nullopt;
  Detail out{{}, static_cast<float>(pixel)};
  for (size_t c = 0; c < 3; ++c) {
    if (!std::isfinite(info.detail_middle[c]))
      fail(Status::input, "info.detail_middle[{}] is {}", c, info.detail_middle[c]);
    out.at[c] = static_cast<float>(info.detail_middle[c]);
  }
  return out;
}

// A copy of the scene with the non-null arrays replaced.
std::shared_ptr<const Scene> with_values(const Scene& scene, const vsplat_gaussians& a) {
  const size_t n = scene.gaussians.count;
  if (a.capacity < n) fail(Status::usage, "arrays.capacity is {}: the scene has {} Gaussians", a.capacity, n);
  const auto finite = [](float v) { return std::isfinite(v); };
  check_rotations(a.rotations, n);
  auto out = std::make_shared<Scene>(scene);
  Gaussians& g = out->gaussians;
  replace(g.means, a.means, n, 3, "means", finite, "a finite number");
  std::vector<float> scales;
  replace(
      scales, a.scales, n, 3, "scales", [](float v) { return v >= 0 && std::isfinite(v); }, "a number from 0 up");
  if (a.scales) g.scales = g.kind == GaussianKind::surfel ? tangent_scales(a.scales, n) : std::move(scales);
  replace(g.quats, a.rotations, n, 4, "rotations", finite, "a finite number");
  replace(
      g.opacities, a.opacities, n, 1, "opacities", [](float v) { return v >= 0 && v <= 1; }, "0 to 1");
  replace(g.sh, a.sh, n, 3 * g.sh_count(), "sh", finite, "a finite number");
  return out;
}

}  // namespace

std::optional<std::array<float, 3>> vsplat::api::up_of(const double (&up)[3], const char* what) {
  const double length = std::hypot(up[0], up[1], up[2]);
  if (!std::isfinite(length)) fail(Status::input, "{} is {} {} {}: finite numbers expected", what, up[0], up[1], up[2]);
  if (length == 0) return std::nullopt;
  const auto part = [&](double v) { return static_cast<float>(v / length); };
  return std::array<float, 3>{part(up[0]), part(up[1]), part(up[2])};
}

void vsplat::api::add_to(Outputs& outputs, const vsplat_gaussians& arrays, std::size_t count, int sh_degree,
                         const std::string& what) {
  const std::size_t bytes = count * sizeof(float),
                    functions = static_cast<std::size_t>(sh_degree + 1) * (sh_degree + 1);
  outputs.add(arrays.means, 3 * bytes, what + ".means");
  outputs.add(arrays.scales, 3 * bytes, what + ".scales");
  outputs.add(arrays.rotations, 4 * bytes, what + ".rotations");
  outputs.add(arrays.opacities, bytes, what + ".opacities");
  outputs.add(arrays.sh, 3 * functions * bytes, what + ".sh");
}

void vsplat::api::copy_out(const Gaussians& from, const vsplat_gaussians& to) {
  const auto copy = [](const std::vector<float>& values, float* out) {
    if (out) std::copy(values.begin(), values.end(), out);
  };
  copy(from.means, to.means);
  copy(from.quats, to.rotations);
  copy(from.opacities, to.opacities);
  copy(from.sh, to.sh);
  if (from.kind == GaussianKind::volume) return copy(from.scales, to.scales);
  for (size_t k = 0; to.scales && k < from.count; ++k) {
    to.scales[3 * k] = from.scales[2 * k];
    to.scales[3 * k + 1] = from.scales[2 * k + 1];
    to.scales[3 * k + 2] = 0;
  }
}

vsplat_status vsplat_scene_load(const char* path, vsplat_scene* out_scene) {
  return vsplat_scene_load_with(path, nullptr, out_scene);
}

vsplat_status vsplat_scene_load_with(const char* path, const vsplat_scene_load_options* options,
                                     vsplat_scene* out_scene) {
  return guarded([&] {
    need(path, "path");
    need(out_scene, "out_scene");
    const vsplat_scene_load_options o = taken(options, VSPLAT_SCENE_LOAD_OPTIONS_INIT, "options");
    auto scene = std::make_unique<vsplat_scene_impl>();
    if (std::string_view(path) == "-")
      fail(Status::file, "-: a scene cannot be read from the standard input: write it to a file first");
    scene->become(std::make_shared<const Scene>(read_scene(path, o.skip_bad ? &scene->skipped : nullptr)));
    *out_scene = scene.release();
  });
}

vsplat_status vsplat_scene_load_memory(const void* bytes, size_t size, const vsplat_scene_load_options* options,
                                       vsplat_scene* out_scene) {
  return guarded([&] {
    need(bytes, "bytes");
    need(out_scene, "out_scene");
    const vsplat_scene_load_options o = taken(options, VSPLAT_SCENE_LOAD_OPTIONS_INIT, "options");
    auto scene = std::make_unique<vsplat_scene_impl>();
    const std::span content(static_cast<const std::byte*>(bytes), size);
    scene->become(std::make_shared<const Scene>(
        read_scene("the scene in memory", content, o.skip_bad ? &scene->skipped : nullptr)));
    *out_scene = scene.release();
  });
}

vsplat_status vsplat_scene_create(const vsplat_scene_info* info, const vsplat_gaussians* arrays,
                                  vsplat_scene* out_scene) {
  return guarded([&] {
    need(info, "info");
    need(arrays, "arrays");
    need(out_scene, "out_scene");
    const vsplat_scene_info i = taken(info, VSPLAT_SCENE_INFO_INIT, "info");
    const vsplat_gaussians a = taken(arrays, VSPLAT_GAUSSIANS_INIT, "arrays");
    if (i.sh_degree < 0 || i.sh_degree > 4) fail(Status::usage, "info.sh_degree is {}: 0 to 4 expected", i.sh_degree);
    if (i.count > INT32_MAX) fail(Status::usage, "info.count is {}: at most {} Gaussians", i.count, INT32_MAX);
    if (!(i.near_plane >= 0) || !std::isfinite(i.near_plane))
      fail(Status::usage, "info.near_plane is {}", i.near_plane);
    need_array(a.means, i.count, "arrays.means");
    need_array(a.scales, i.count, "arrays.scales");
    need_array(a.rotations, i.count, "arrays.rotations");
    need_array(a.opacities, i.count, "arrays.opacities");
    need_array(a.sh, i.count, "arrays.sh");
    Scene empty;
    empty.gaussians.count = i.count;
    empty.gaussians.sh_degree = i.sh_degree;
    if (i.surfels != 0 && i.surfels != 1) fail(Status::usage, "info.surfels is {}: 0 or 1 expected", i.surfels);
    if (i.surfels) empty.gaussians.kind = GaussianKind::surfel;
    if (i.near_plane > 0) empty.near = static_cast<float>(i.near_plane);
    if (i.has_mirror) {
      empty.mirror.emplace();
      for (size_t c = 0; c < 3; ++c) {
        if (!std::isfinite(i.mirror[c])) fail(Status::input, "info.mirror[{}] is {}", c, i.mirror[c]);
        (*empty.mirror)[c] = static_cast<float>(i.mirror[c]);
      }
    }
    empty.up = up_of(i.up, "info.up");
    for (size_t c = 0; c < 3; ++c) {
      if (!(std::abs(i.offset[c]) <= kFarthestOffset))
        fail(Status::input, "info.offset[{}] is {}: at most {} either way expected", c, i.offset[c], kFarthestOffset);
      empty.offset[static_cast<Eigen::Index>(c)] = i.offset[c];
    }
    empty.detail = detail_of(i);
    if (i.antialias != 0 && i.antialias != 1) fail(Status::usage, "info.antialias is {}: 0 or 1 expected", i.antialias);
    if (i.antialias && i.surfels) fail(Status::usage, "info.antialias is 1: 0 expected for surfels");
    empty.antialias = i.antialias != 0;
    auto scene = std::make_unique<vsplat_scene_impl>();
    scene->become(with_values(empty, a));
    *out_scene = scene.release();
  });
}

vsplat_status vsplat_scene_update(vsplat_scene scene, const vsplat_gaussians* arrays) {
  return guarded([&] {
    need(scene, "scene");
    need(arrays, "arrays");
    scene->become(with_values(*scene->now(), taken(arrays, VSPLAT_GAUSSIANS_INIT, "arrays")));
  });
}

void vsplat_scene_retain(vsplat_scene scene) { retain(scene); }
void vsplat_scene_release(vsplat_scene scene) { release(scene); }

vsplat_status vsplat_scene_get_info(vsplat_scene scene, vsplat_scene_info* out_info) {
  return guarded([&] {
    need(scene, "scene");
    const std::shared_ptr<const Scene> now = scene->now();
    const Scene& s = *now;
    vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
    info.count = s.gaussians.count;
    info.sh_degree = s.gaussians.sh_degree;
    info.near_plane = static_cast<double>(s.near);
    info.has_mirror = s.mirror.has_value();
    for (size_t i = 0; s.mirror && i < 3; ++i) info.mirror[i] = static_cast<double>((*s.mirror)[i]);
    for (size_t c = 0; s.up && c < 3; ++c) info.up[c] = static_cast<double>((*s.up)[c]);
    for (size_t c = 0; c < 3; ++c) info.offset[c] = s.offset[static_cast<Eigen::Index>(c)];
    info.surfels = s.gaussians.kind == GaussianKind::surfel;
    if (s.detail) info.detail_pixel = static_cast<double>(s.detail->pixel);
    for (size_t c = 0; s.detail && c < 3; ++c) info.detail_middle[c] = static_cast<double>(s.detail->at[c]);
    info.antialias = s.antialias;
    info.skipped_not_finite = scene->skipped.not_finite;
    info.skipped_huge_scale = scene->skipped.huge_scale;
    info.skipped_zero_rotation = scene->skipped.zero_rotation;
    give(out_info, info, "out_info");
  });
}

vsplat_status vsplat_scene_get_gaussians(vsplat_scene scene, const vsplat_gaussians* arrays) {
  return guarded([&] {
    need(scene, "scene");
    need(arrays, "arrays");
    const vsplat_gaussians a = taken(arrays, VSPLAT_GAUSSIANS_INIT, "arrays");
    const std::shared_ptr<const Scene> now = scene->now();
    const Gaussians& g = now->gaussians;
    if (a.capacity < g.count)
      fail(Status::usage, "arrays.capacity is {}: the scene has {} Gaussians", a.capacity, g.count);
    Outputs outputs;
    add_to(outputs, a, g.count, g.sh_degree, "arrays");
    outputs.refuse_shared();
    copy_out(g, a);
  });
}

vsplat_status vsplat_scene_get_selection(vsplat_scene scene, int32_t* out_voxels, size_t capacity, size_t* out_count) {
  return guarded([&] {
    need(scene, "scene");
    need(out_count, "out_count");
    need_array(out_voxels, capacity, "out_voxels");
    const std::vector<int>& selected = scene->selected;
    std::copy_n(selected.begin(), std::min(capacity, selected.size()), out_voxels);
    *out_count = selected.size();
  });
}

vsplat_status vsplat_scene_save_selection(vsplat_scene scene, const char* path) {
  return guarded([&] {
    need(scene, "scene");
    need(path, "path");
    write_selection(path, scene->selected);
  });
}
