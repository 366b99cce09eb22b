// Fitting a scene for C++, see vsplat/refine.h. Part of vsplat.hpp, which includes this file.
#ifndef VSPLAT_REFINE_HPP
#define VSPLAT_REFINE_HPP

#include <vsplat/vsplat.hpp>

namespace vsplat {
inline namespace cxx {

using RefinementHandle = Handle<vsplat_refinement, vsplat_refinement_retain, vsplat_refinement_release>;

class Refinement : public RefinementHandle {
 public:
  Refinement() = default;
  Refinement(const Device& device, const Views& views, const vsplat_refine_options& options)
      : RefinementHandle(create(device, views, options)) {}

  // Runs a step and fills `progress`. Returns whether there is a further step.
  bool step(vsplat_refine_progress& progress) const {
    int32_t more = 0;
    check(vsplat_refinement_step(get(), &progress, &more));
    return more != 0;
  }
  bool step() const {
    int32_t more = 0;
    check(vsplat_refinement_step(get(), nullptr, &more));
    return more != 0;
  }
  void stop() const { check(vsplat_refinement_stop(get())); }

  Scene scene() const {
    vsplat_scene out = nullptr;
    check(vsplat_refinement_get_scene(get(), &out));
    return Scene(out);
  }
  Scene start() const {
    vsplat_scene out = nullptr;
    check(vsplat_refinement_get_start(get(), &out));
    return Scene(out);
  }
  vsplat_refine_result result() const {
    vsplat_refine_result out = VSPLAT_REFINE_RESULT_INIT;
    check(vsplat_refinement_get_result(get(), &out));
    return out;
  }
  // Indices into the list of views.
  std::vector<int32_t> views(vsplat_refine_views which) const {
    size_t count = 0;
    check(vsplat_refinement_get_views(get(), which, nullptr, 0, &count));
    std::vector<int32_t> out(count);
    check(vsplat_refinement_get_views(get(), which, out.data(), out.size(), &count));
    return out;
  }
  vsplat_camera camera(size_t view) const {
    vsplat_camera out = VSPLAT_CAMERA_INIT;
    check(vsplat_refinement_get_view(get(), view, &out, nullptr, 0));
    return out;
  }
  void save_cameras(const std::string& path) const { check(vsplat_refinement_save_cameras(get(), path.c_str())); }
  // As it is fitted or measured; only `colour` is filled.
  Picture picture(size_t view) const {
    const vsplat_camera about = camera(view);
    Picture out(about.width, about.height);
    check(vsplat_refinement_get_view(get(), view, nullptr, out.colour.data(), out.colour.size()));
    return out;
  }

 private:
  static vsplat_refinement create(const Device& device, const Views& views, const vsplat_refine_options& options) {
    vsplat_refinement out = nullptr;
    check(vsplat_refinement_create(device.get(), views.get(), &options, &out));
    return out;
  }
};

inline vsplat_plan refinement_plan(const Device& device, uint64_t gaussians, int sh_degree, int width, int height) {
  vsplat_plan out = VSPLAT_PLAN_INIT;
  check(vsplat_plan_refinement(device.get(), gaussians, sh_degree, width, height, &out));
  return out;
}

}  // namespace cxx
}  // namespace vsplat

#endif
