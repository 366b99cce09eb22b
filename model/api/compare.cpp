// Comparing given pictures with drawn ones.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "model/api/cameras.h"
#include "model/io/picture/image_file.h"
#include "model/io/views/listed_file.h"
#include "model/io/views/view_checks.h"
#include "model/metrics/metrics.h"
#include "model/metrics/reference_picture.h"
#include "model/views/photographs.h"
#include "runtime/fail.h"
#include "runtime/files/roots.h"
#include "runtime/log.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

Image clamped(const float* data, int width, int height) {
  Image out(width, height, 3);
  std::transform(data, data + out.data.size(), out.data.begin(), [](float v) { return std::clamp(v, 0.0f, 1.0f); });
  return out;
}

}  // namespace

vsplat_status vsplat_cameras_find_picture(vsplat_cameras cameras, size_t index, const char* folder, char** out_path) {
  return guarded([&] {
    need(cameras, "cameras");
    need(out_path, "out_path");
    const std::string& listed = cameras->at(index).file;
    if (!folder) {
      *out_path = new_text(index < cameras->listed.views.size() ? cameras->listed.views[index].picture.string() : "");
      return;
    }
    std::error_code error;
    if (!std::filesystem::is_directory(folder, error)) fail(Status::file, "{}: no such folder of pictures", folder);
    const std::string name = listed.empty() ? fmt::format("{:04}", index) : listed;
    ListedFiles files({folder});
    const std::filesystem::path found = files.find(name).path;
    if (found.empty()) {
      info("camera {}: {}", index, files.where_looked(name));
    } else {
      Roots roots;
      roots.add(folder);
      roots.need(found, fmt::format("{}: the camera's picture", folder));
    }
    *out_path = new_text(found.string());
  });
}

namespace {

// The orientation that turns the file's picture into what the listed camera saw.
int turning_in(vsplat_cameras cameras, size_t index, const char* path, const ImageInfo& info) {
  if (index >= cameras->listed.views.size()) return 1;  // made by the caller, not listed
  ListedView view = cameras->listed.views[index];
  view.picture = path;
  return turning_of(cameras->listed, view, info);
}

}  // namespace

vsplat_status vsplat_cameras_get_picture_size(vsplat_cameras cameras, size_t index, const char* path,
                                              int32_t* out_width, int32_t* out_height) {
  return guarded([&] {
    need(cameras, "cameras");
    need(path, "path");
    cameras->at(index);
    ImageInfo info = read_image_info(path);
    if (turning_in(cameras, index, path, info) >= 5) std::swap(info.width, info.height);
    if (out_width) *out_width = info.width;
    if (out_height) *out_height = info.height;
  });
}

vsplat_status vsplat_picture_file_size(const char* path, int32_t* out_width, int32_t* out_height) {
  return guarded([&] {
    need(path, "path");
    const ImageInfo info = read_image_info(path);
    if (out_width) *out_width = info.width;
    if (out_height) *out_height = info.height;
  });
}

vsplat_status vsplat_picture_file_lens(const char* path, char** out_text) {
  return guarded([&] {
    need(path, "path");
    need(out_text, "out_text");
    *out_text = new_text(read_image_info(path).lens);
  });
}

vsplat_status vsplat_cameras_load_picture(vsplat_cameras cameras, size_t index, const char* path, int32_t width,
                                          int32_t height, const float background[3], float* out_pixels,
                                          size_t capacity) {
  return guarded([&] {
    need(cameras, "cameras");
    need(path, "path");
    need(background, "background");
    need(out_pixels, "out_pixels");
    const Camera& camera = cameras->at(index);
    const bool is_listed = index < cameras->listed.views.size();
    const std::filesystem::path mask = is_listed ? cameras->listed.views[index].mask.value_or("") : "";
    const int turning = turning_in(cameras, index, path, read_image_info(path));
    const Image picture = reference_picture(camera, {path, mask.string(), turning}, width, height,
                                            {background[0], background[1], background[2]});
    if (capacity < picture.data.size())
      fail(Status::usage, "capacity is {} floats: the picture has {}", capacity, picture.data.size());
    std::copy(picture.data.begin(), picture.data.end(), out_pixels);
  });
}

vsplat_status vsplat_compare(const float* pixels, const float* reference, int32_t width, int32_t height,
                             vsplat_comparison* out_comparison, float* out_difference) {
  return guarded([&] {
    need(pixels, "pixels");
    need(reference, "reference");
    require_output(out_comparison, "out_comparison");
    const Image a = clamped(pixels, picture_side("pixels", "width", width), picture_side("pixels", "height", height)),
                b = clamped(reference, width, height);
    vsplat_comparison found = VSPLAT_COMPARISON_INIT;
    found.psnr = psnr(a, b);
    found.ssim = ssim(a, b);
    found.psnr_cc = psnr_cc(a, b);
    give(out_comparison, found, "out_comparison");
    if (!out_difference) return;
    const Image difference = absolute_difference(a, b);
    std::copy(difference.data.begin(), difference.data.end(), out_difference);
  });
}
