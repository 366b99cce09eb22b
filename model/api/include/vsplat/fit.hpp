// Fitting a scene for C++, see vsplat/fit.h. Part of vsplat.hpp, which includes this file.
#ifndef VSPLAT_FIT_HPP
#define VSPLAT_FIT_HPP

#include <vsplat/vsplat.hpp>

namespace vsplat {
inline namespace cxx {

using FitHandle = Handle<vsplat_fit, vsplat_fit_retain, vsplat_fit_release>;

class Fit : public FitHandle {
 public:
  Fit() = default;
  Fit(const Device& device, const Views& views, const vsplat_fit_options& options)
      : FitHandle(create(device, views, options)) {}

  // Runs a step and fills `progress`. Returns whether there is a further step.
  bool step(vsplat_fit_progress& progress) const {
    int32_t more = 0;
    check(vsplat_fit_step(get(), &progress, &more));
    return more != 0;
  }
  bool step() const {
    int32_t more = 0;
    check(vsplat_fit_step(get(), nullptr, &more));
    return more != 0;
  }
  void stop() const { check(vsplat_fit_stop(get())); }

  Scene scene() const {
    vsplat_scene out = nullptr;
    check(vsplat_fit_get_scene(get(), &out));
    return Scene(out);
  }
  Scene start() const {
    vsplat_scene out = nullptr;
    check(vsplat_fit_get_start(get(), &out));
    return Scene(out);
  }
  vsplat_fit_result result() const {
    vsplat_fit_result out = VSPLAT_FIT_RESULT_INIT;
    check(vsplat_fit_get_result(get(), &out));
    return out;
  }
  // JSON, see vsplat_fit_get_settings.
  std::string settings() const {
    char* out = nullptr;
    check(vsplat_fit_get_settings(get(), &out));
    return text(out);
  }
  vsplat_plan plan() const {
    vsplat_plan out = VSPLAT_PLAN_INIT;
    check(vsplat_fit_get_plan(get(), &out));
    return out;
  }
  // Indices into the list of views.
  std::vector<int32_t> views(vsplat_fit_views which) const {
    size_t count = 0;
    check(vsplat_fit_get_views(get(), which, nullptr, 0, &count));
    std::vector<int32_t> out(count);
    check(vsplat_fit_get_views(get(), which, out.data(), out.size(), &count));
    return out;
  }
  vsplat_camera camera(size_t view) const {
    vsplat_camera out = VSPLAT_CAMERA_INIT;
    check(vsplat_fit_get_view(get(), view, &out, nullptr, 0));
    return out;
  }
  void save_cameras(const std::string& path) const { check(vsplat_fit_save_cameras(get(), path.c_str())); }
  // As it is fitted or measured; only `colour` is filled.
  Picture picture(size_t view) const {
    const vsplat_camera about = camera(view);
    Picture out(about.width, about.height);
    check(vsplat_fit_get_view(get(), view, nullptr, out.colour.data(), out.colour.size()));
    return out;
  }

 private:
  static vsplat_fit create(const Device& device, const Views& views, const vsplat_fit_options& options) {
    vsplat_fit out = nullptr;
    check(vsplat_fit_create(device.get(), views.get(), &options, &out));
    return out;
  }
};

using Refinement = Fit;  // its earlier name

inline vsplat_plan fit_plan(const Device& device, uint64_t gaussians, int sh_degree, int width, int height) {
  vsplat_plan out = VSPLAT_PLAN_INIT;
  check(vsplat_plan_fit(device.get(), gaussians, sh_degree, width, height, &out));
  return out;
}

}  // namespace cxx
}  // namespace vsplat

#endif
