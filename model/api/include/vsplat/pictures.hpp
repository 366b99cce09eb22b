// Contact sheets and animations for C++, see vsplat/pictures.h. Part of vsplat.hpp, which includes this file.
#ifndef VSPLAT_PICTURES_HPP
#define VSPLAT_PICTURES_HPP

#include <string>
#include <vsplat/vsplat.hpp>

namespace vsplat {
inline namespace cxx {

// PSNR and SSIM of [height][width][3] pictures; `difference`, unless empty, receives their absolute difference.
inline vsplat_comparison compare(Span<const float> pixels, Span<const float> reference, int32_t width, int32_t height,
                                 Span<float> difference = {}) {
  const std::size_t values =
      width > 0 && height > 0 ? 3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height) : 0;
  vsplat_comparison out = VSPLAT_COMPARISON_INIT;
  check(vsplat_compare(detail::pointer(pixels, values, "pixels"), detail::pointer(reference, values, "reference"),
                       width, height, &out,
                       detail::pointer(difference, difference.empty() ? 0 : values, "difference")));
  return out;
}

using SheetHandle = Handle<vsplat_sheet, vsplat_sheet_retain, vsplat_sheet_release>;
using AnimationHandle = Handle<vsplat_animation, vsplat_animation_retain, vsplat_animation_release>;

class Sheet : public SheetHandle {
 public:
  Sheet() = default;
  explicit Sheet(const vsplat_sheet_options& options) : SheetHandle(create(options)) {}

  void add(const Picture& picture, const std::string& label = "") {
    const vsplat_picture p = ConstPictureSpans(picture).arrays(picture.width, picture.height);
    check(vsplat_sheet_add_labelled(get(), &p, picture.width, picture.height, label.c_str()));
  }
  void save(const std::string& path) const { check(vsplat_sheet_save(get(), path.c_str())); }

 private:
  static vsplat_sheet create(const vsplat_sheet_options& options) {
    vsplat_sheet out = nullptr;
    check(vsplat_sheet_create(&options, &out));
    return out;
  }
};

class Animation : public AnimationHandle {
 public:
  Animation() = default;
  explicit Animation(const vsplat_animation_options& options) : AnimationHandle(create(options)) {}

  void add(const Picture& picture) {
    const vsplat_picture p = ConstPictureSpans(picture).arrays(picture.width, picture.height);
    check(vsplat_animation_add(get(), &p, picture.width, picture.height));
  }
  void save(const std::string& path) const { check(vsplat_animation_save(get(), path.c_str())); }

 private:
  static vsplat_animation create(const vsplat_animation_options& options) {
    vsplat_animation out = nullptr;
    check(vsplat_animation_create(&options, &out));
    return out;
  }
};

}  // namespace cxx
}  // namespace vsplat

#endif
