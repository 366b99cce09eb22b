// Drawn pictures into files: single ones, contact sheets, animations.
#include <algorithm>
#include <cmath>
#include <tuple>
#include <vector>

#include "model/api/handle.h"
#include "model/io/picture/animation.h"
#include "model/io/picture/contact_sheet.h"
#include "model/io/picture/image_file.h"
#include "runtime/fail.h"

struct vsplat_sheet_impl : vsplat::api::Counted {
  explicit vsplat_sheet_impl(const vsplat::SheetOptions& options) : sheet(options) {}
  vsplat::ContactSheet sheet;
};

struct vsplat_animation_impl : vsplat::api::Counted {
  explicit vsplat_animation_impl(std::unique_ptr<vsplat::AnimationFile> of) : animation(std::move(of)) {}
  std::unique_ptr<vsplat::AnimationFile> animation;
};

using namespace vsplat;
using namespace vsplat::api;

namespace {

constexpr int usual_quality = 90;

// The caller's struct, whose arrays must hold a picture of that size.
vsplat_picture picture_of(const vsplat_picture* picture, int32_t width, int32_t height) {
  need(picture, "picture");
  const vsplat_picture p = taken(picture, VSPLAT_PICTURE_INIT, "picture");
  if (width < 1 || height < 1 || p.capacity / static_cast<uint64_t>(width) < static_cast<uint64_t>(height))
    fail(Status::usage, "a picture of {} x {} pixels in arrays of {}", width, height, p.capacity);
  return p;
}

Image image_of(const float* data, int width, int height, int channels, const char* what) {
  need(data, what);
  Image out(width, height, channels);
  std::copy_n(data, out.data.size(), out.data.begin());
  return out;
}

// Straight alpha from a picture accumulated over black.
Image straight(const Image& colour, const Image& alpha) {
  Image out(colour.width, colour.height, 4);
  for (std::size_t i = 0; i < alpha.data.size(); ++i) {
    const float a = std::clamp(alpha.data[i], 0.0f, 1.0f);
    for (std::size_t c = 0; c < 3; ++c) out.data[4 * i + c] = a > 0 ? std::min(colour.data[3 * i + c] / a, 1.0f) : 0;
    out.data[4 * i + 3] = a;
  }
  return out;
}

// Normals of length 1 as colours of a picture: right, up and towards the camera are more red, green and blue. Black
// where there are none.
Image shown_normals(Image normals) {
  for (std::size_t i = 0; i < normals.data.size(); i += 3) {
    float* n = &normals.data[i];
    const float length = std::hypot(n[0], n[1], n[2]);
    for (const int c : {0, 1, 2}) n[c] = length > 0 ? 0.5f + (c == 0 ? 0.5f : -0.5f) * n[c] / length : 0;
  }
  return normals;
}

// The surface maps that the caller gave.
std::vector<PictureLayer> layers_of(const vsplat_picture& p, int width, int height) {
  std::vector<PictureLayer> out;
  for (const auto& [name, data, channels] :
       {std::tuple("expected", p.expected, 1), std::tuple("median", p.median, 1), std::tuple("normal", p.normal, 3)})
    if (data) out.push_back({name, image_of(data, width, height, channels, name)});
  return out;
}

Image colour_of(const vsplat_picture* picture, int32_t width, int32_t height) {
  return image_of(picture_of(picture, width, height).colour, width, height, 3, "picture.colour");
}

void save_picture(const vsplat_picture* picture, int32_t width, int32_t height, const vsplat_picture_format& format,
                  const std::string& path) {
  const vsplat_picture p = picture_of(picture, width, height);
  const int kind = value_of(format);
  if (kind == VSPLAT_PICTURE_PNG_EXPECTED)
    return write_depth_png(path, image_of(p.expected, width, height, 1, "picture.expected"));
  if (kind == VSPLAT_PICTURE_PNG_MEDIAN)
    return write_depth_png(path, image_of(p.median, width, height, 1, "picture.median"));
  if (kind == VSPLAT_PICTURE_PNG_NORMAL)
    return write_png(path, shown_normals(image_of(p.normal, width, height, 3, "picture.normal")));
  const Image colour = image_of(p.colour, width, height, 3, "picture.colour");
  if (kind == VSPLAT_PICTURE_PNG) return write_png(path, colour);
  if (kind == VSPLAT_PICTURE_JPEG) return write_jpeg(path, colour, usual_quality);
  if (kind != VSPLAT_PICTURE_EXR && kind != VSPLAT_PICTURE_EXR_RAW && kind != VSPLAT_PICTURE_PNG_ALPHA)
    fail(Status::usage, "format is {}, not a value of vsplat_picture_format", kind);
  const Image alpha = image_of(p.alpha, width, height, 1, "picture.alpha");
  if (kind == VSPLAT_PICTURE_PNG_ALPHA) return write_png(path, straight(colour, alpha));
  const Image depth = image_of(p.depth, width, height, 1, "picture.depth");
  (kind == VSPLAT_PICTURE_EXR ? write_exr : write_exr_raw)(path, colour, alpha, depth, layers_of(p, width, height));
}

}  // namespace

vsplat_status vsplat_picture_save(const vsplat_picture* picture, int32_t width, int32_t height,
                                  vsplat_picture_format format, const char* path) {
  return guarded([&] {
    need(path, "path");
    save_picture(picture, width, height, format, path);
  });
}

vsplat_status vsplat_picture_save_memory(const vsplat_picture* picture, int32_t width, int32_t height,
                                         vsplat_picture_format format, char** out_bytes, size_t* out_size) {
  return guarded([&] {
    give_bytes([&](const std::string& name) { save_picture(picture, width, height, format, name); }, "the picture",
               out_bytes, out_size);
  });
}

vsplat_status vsplat_picture_save_jpeg(const vsplat_picture* picture, int32_t width, int32_t height, int32_t quality,
                                       const char* path) {
  return guarded([&] {
    need(path, "path");
    write_jpeg(path, colour_of(picture, width, height), quality);
  });
}

vsplat_status vsplat_sheet_create(const vsplat_sheet_options* options, vsplat_sheet* out_sheet) {
  return guarded([&] {
    need(out_sheet, "out_sheet");
    const vsplat_sheet_options o = taken(options, VSPLAT_SHEET_OPTIONS_INIT, "options");
    *out_sheet = std::make_unique<vsplat_sheet_impl>(SheetOptions{o.cell, o.columns, o.expected}).release();
  });
}

void vsplat_sheet_retain(vsplat_sheet sheet) { retain(sheet); }
void vsplat_sheet_release(vsplat_sheet sheet) { release(sheet); }

vsplat_status vsplat_sheet_add(vsplat_sheet sheet, const vsplat_picture* picture, int32_t width, int32_t height) {
  return vsplat_sheet_add_labelled(sheet, picture, width, height, nullptr);
}

vsplat_status vsplat_sheet_add_labelled(vsplat_sheet sheet, const vsplat_picture* picture, int32_t width,
                                        int32_t height, const char* label) {
  return guarded([&] {
    need(sheet, "sheet");
    sheet->sheet.add(colour_of(picture, width, height), label ? label : "");
  });
}

vsplat_status vsplat_sheet_save(vsplat_sheet sheet, const char* path) {
  return guarded([&] {
    need(sheet, "sheet");
    need(path, "path");
    write_png(path, sheet->sheet.sheet());
  });
}

vsplat_status vsplat_animation_create(const vsplat_animation_options* options, vsplat_animation* out_animation) {
  return guarded([&] {
    need(out_animation, "out_animation");
    const vsplat_animation_options o = taken(options, VSPLAT_ANIMATION_OPTIONS_INIT, "options");
    if (o.format != VSPLAT_ANIMATION_WEBP && o.format != VSPLAT_ANIMATION_GIF)
      fail(Status::usage, "format is {}, not a value of vsplat_animation_format", o.format);
    const auto make = o.format == VSPLAT_ANIMATION_GIF ? gif_animation : webp_animation;
    *out_animation = std::make_unique<vsplat_animation_impl>(make({o.fps, o.quality})).release();
  });
}

void vsplat_animation_retain(vsplat_animation animation) { retain(animation); }
void vsplat_animation_release(vsplat_animation animation) { release(animation); }

vsplat_status vsplat_animation_add(vsplat_animation animation, const vsplat_picture* picture, int32_t width,
                                   int32_t height) {
  return guarded([&] {
    need(animation, "animation");
    animation->animation->add(colour_of(picture, width, height));
  });
}

vsplat_status vsplat_animation_save(vsplat_animation animation, const char* path) {
  return guarded([&] {
    need(animation, "animation");
    need(path, "path");
    animation->animation->write(path);
  });
}
