// Views as they were taken, and as the network gets them.
#include "model/api/input.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <filesystem>

#include "model/api/cameras.h"
#include "model/api/model.h"
#include "model/api/pixels.h"
#include "model/views/orbit.h"
#include "model/views/view_choice.h"
#include "model/views/written_views.h"
#include "runtime/fail.h"
#include "runtime/half.h"
#include "runtime/option.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

// The values of pixel rows as floats.
class Rows {
 public:
  Rows(const vsplat_view& view, const std::string& where)
      : field_(view.pixels ? "pixels" : "data"),
        data_(static_cast<const unsigned char*>(view.pixels ? view.pixels : view.data)),
        type_(view.pixels ? static_cast<int>(VSPLAT_PIXELS_F32) : value_of(view.type)) {
    if ((view.pixels != nullptr) == (view.data != nullptr))
      fail(Status::usage, "{}: exactly one of pixels and data is expected, {}", where,
           view.pixels ? "both are set" : "both are null");
    if (view.channels != 3 && view.channels != 4)
      fail(Status::usage, "{}.channels is {}: 3 (RGB) or 4 (RGBA) expected", where, view.channels);
    if (type_ != VSPLAT_PIXELS_F32 && type_ != VSPLAT_PIXELS_F16 && type_ != VSPLAT_PIXELS_U8)
      fail(Status::usage, "{}.type is {}, not a value of vsplat_pixel_type", where, type_);
    if (view.premultiplied && view.channels == 3)
      fail(Status::usage, "{}.premultiplied is {}: there is no alpha, channels is 3", where, view.premultiplied);
    const size_t row = static_cast<size_t>(view.camera.width) * static_cast<size_t>(view.channels) * bytes();
    row_bytes_ = view.row_bytes && !view.pixels ? view.row_bytes : row;
    if (row_bytes_ < row)
      fail(Status::usage, "{}.row_bytes is {}: a row of {} pixels with {} channels has {} bytes", where, row_bytes_,
           view.camera.width, view.channels, row);
    bytes_of_rows(static_cast<size_t>(view.camera.height), row, row_bytes_, view.pixels ? 0 : view.data_bytes, where);
  }
  const char* field() const { return field_; }
  float at(int y, size_t i) const {  // (Rows may begin at any address, so values are copied.)
    const unsigned char* from = data_ + static_cast<size_t>(y) * row_bytes_ + i * bytes();
    if (type_ == VSPLAT_PIXELS_U8) return static_cast<float>(*from) / 255.0f;
    if (type_ == VSPLAT_PIXELS_F16) {
      std::uint16_t half = 0;
      std::memcpy(&half, from, sizeof half);
      return from_half(half);
    }
    float out = 0;
    std::memcpy(&out, from, sizeof out);
    return out;
  }

 private:
  size_t bytes() const { return type_ == VSPLAT_PIXELS_U8 ? 1 : type_ == VSPLAT_PIXELS_F16 ? 2 : 4; }

  const char* field_;
  const unsigned char* data_;
  int type_;
  size_t row_bytes_ = 0;
};

// Divides colour by alpha; transparent pixels become white.
void make_straight(Image& picture) {
  for (size_t i = 0; i + 3 < picture.data.size(); i += 4)
    for (size_t c = 0; c < 3; ++c) {
      const float alpha = picture.data[i + 3];
      picture.data[i + c] = alpha > 0 ? std::min(picture.data[i + c] / alpha, 1.0f) : 1.0f;
    }
}

// Pictures hold 0 to 1. Values slightly outside, as resampling produces, are clamped, as storing them in a file would
// do.
void take_pixels(const Rows& from, const std::string& where, Image& to) {
  constexpr float overshoot = 0.5f;
  const size_t row = static_cast<size_t>(to.width) * static_cast<size_t>(to.channels);
  for (size_t i = 0; i < to.data.size(); ++i) {
    const float value = from.at(static_cast<int>(i / row), i % row);
    if (!(value >= -overshoot && value <= 1 + overshoot)) {  // also catches NaN
      const size_t channels = static_cast<size_t>(to.channels), pixel = i / channels;
      const size_t width = static_cast<size_t>(to.width);
      fail(Status::input,
           "{}.{}: pixel {}, {} of channel {} is {}: 0 to 1 expected (pass 8-bit values as VSPLAT_PIXELS_U8 data, or "
           "divide them by 255)",
           where, from.field(), pixel % width, pixel / width, i % channels, value);
    }
    to.data[i] = std::clamp(value, 0.0f, 1.0f);
  }
}

}  // namespace

vsplat_status vsplat_views_load(const char* path, const char* pictures, vsplat_views* out_views) {
  return guarded([&] {
    need(path, "path");
    need(out_views, "out_views");
    auto views = std::make_unique<vsplat_views_impl>();
    views->photographs.set = read_views(path, {.pictures_dir = pictures ? pictures : ""});
    *out_views = views.release();
  });
}

vsplat_status vsplat_views_load_with(const char* path, const vsplat_views_options* options, vsplat_views* out_views) {
  return guarded([&] {
    need(path, "path");
    need(out_views, "out_views");
    const vsplat_views_options o = taken(options, VSPLAT_VIEWS_OPTIONS_INIT, "options");
    ReadOptions how;
    if (o.pictures) how.pictures_dir = o.pictures;
    how.bad = o.skip_bad ? BadViews::leave_out : o.check_later ? BadViews::keep : BadViews::refuse;
    auto views = std::make_unique<vsplat_views_impl>();
    views->photographs.set = read_views(path, how);
    if (o.skip_bad) leave_out_unreadable(views->photographs);
    *out_views = views.release();
  });
}

vsplat_status vsplat_views_create(const vsplat_view* views, size_t num_views, vsplat_views* out_views) {
  return guarded([&] {
    need(views, "views");
    need(out_views, "out_views");
    if (num_views == 0) fail(Status::usage, "num_views is 0");
    need_structs(views, num_views, "views");
    auto out = std::make_unique<vsplat_views_impl>();
    const auto pictures = std::make_shared<std::vector<Image>>();
    out->photographs.set.source = "pictures in memory";
    for (size_t i = 0; i < num_views; ++i) {
      const std::string where = fmt::format("views[{}]", i);
      const vsplat_view view = taken(&element(views, i, "views"), VSPLAT_VIEW_INIT, where.c_str());
      ListedView listed;
      listed.camera = camera_of(view.camera, (where + ".camera").c_str(), true);
      const Rows rows(view, where);
      listed.name = listed.camera.file = std::to_string(i);
      listed.picture = where;  // the picture is in memory
      Image picture(listed.camera.width, listed.camera.height, view.channels);
      take_pixels(rows, where, picture);
      if (view.premultiplied) make_straight(picture);
      out->photographs.set.views.push_back(std::move(listed));
      pictures->push_back(std::move(picture));
    }
    out->photographs.picture = [pictures](int view) { return pictures->at(static_cast<size_t>(view)); };
    *out_views = out.release();
  });
}

void vsplat_views_retain(vsplat_views views) { retain(views); }
void vsplat_views_release(vsplat_views views) { release(views); }

vsplat_status vsplat_views_count(vsplat_views views, size_t* out_count) {
  return guarded([&] {
    need(views, "views");
    need(out_count, "out_count");
    *out_count = views->photographs.set.views.size();
  });
}

vsplat_status vsplat_views_get_memory(vsplat_views views, uint64_t* out_bytes) {
  return guarded([&] {
    need(views, "views");
    need(out_bytes, "out_bytes");
    *out_bytes = static_cast<uint64_t>(host_bytes_to_load(views->photographs));
  });
}

vsplat_status vsplat_views_get_name(vsplat_views views, size_t index, char** out_text) {
  return guarded([&] {
    need(views, "views");
    need(out_text, "out_text");
    const std::vector<ListedView>& listed = views->photographs.set.views;
    if (index >= listed.size()) fail(Status::usage, "there is no view {}: {} in all", index, listed.size());
    *out_text = new_text(listed[index].name);
  });
}

vsplat_status vsplat_views_get_files(vsplat_views views, char** out_text) {
  return guarded([&] {
    need(views, "views");
    need(out_text, "out_text");
    const ViewSet& set = views->photographs.set;
    std::vector<std::filesystem::path> files;
    std::error_code error;
    if (std::filesystem::is_directory(set.source, error)) {  // a COLMAP model
      for (const auto& entry : std::filesystem::directory_iterator(set.source, error)) files.push_back(entry.path());
    } else {
      files.push_back(set.source);
    }
    for (const ListedView& view : set.views) {
      files.push_back(view.picture);
      if (view.mask) files.push_back(*view.mask);
    }
    std::string text;
    for (const std::filesystem::path& file : files)
      if (std::filesystem::is_regular_file(file, error)) text += file.string() + "\n";
    *out_text = new_text(text);
  });
}

Crop vsplat::api::crop_of(const vsplat_crop& crop) {
  switch (value_of(crop)) {
    case VSPLAT_CROP_AUTO:
      return Crop::automatic;
    case VSPLAT_CROP_OBJECT:
      return Crop::object;
    case VSPLAT_CROP_CROP:
      return Crop::crop;
    case VSPLAT_CROP_PAD:
      return Crop::pad;
  }
  fail(Status::usage, "options.crop is {}, not a value of vsplat_crop", value_of(crop));
}

MaskUse vsplat::api::masks_of(const vsplat_masks& masks) {
  switch (value_of(masks)) {
    case VSPLAT_MASKS_OBJECT:
      return MaskUse::object;
    case VSPLAT_MASKS_IGNORE:
      return MaskUse::ignore;
  }
  fail(Status::usage, "options.masks is {}, not a value of vsplat_masks", value_of(masks));
}

std::vector<std::string> vsplat::api::names_of(const char* const* names, size_t count, const std::string& what) {
  need_array(names, count, what.c_str());
  std::vector<std::string> out;
  for (size_t i = 0; i < count; ++i) {
    need(names[i], ("an element of " + what).c_str());
    out.emplace_back(names[i]);
  }
  return out;
}

PlacementRequest vsplat::api::placement_of(bool has_centre, const double (&centre)[3], double edge, bool auto_frame) {
  PlacementRequest out;
  if (has_centre) {
    out.centre = Eigen::Vector3d(centre[0], centre[1], centre[2]);
    if (!out.centre->allFinite()) fail(Status::usage, "options.center is {}", to_text(*out.centre));
  }
  if (!(edge >= 0) || !std::isfinite(edge)) fail(Status::usage, "options.scale is {}", edge);
  if (edge > 0) out.edge = edge;
  out.auto_frame = auto_frame;
  return out;
}

namespace {

const PreparedView& view_at(vsplat_input input, size_t index) {
  need(input, "input");
  if (index >= input->input.views.size())
    fail(Status::usage, "there is no view {}: {} in all", index, input->input.views.size());
  return input->input.views[index];
}

}  // namespace

Eigen::Vector3d vsplat::api::listed_up(const Photographs& photographs) {
  std::vector<Camera> cameras;
  for (const ListedView& view : photographs.set.views)
    if (view.problem.empty()) cameras.push_back(view.camera);
  return world_up(cameras);
}

InputRequest vsplat::api::request_of(const vsplat_input_options& o) {
  InputRequest out;
  out.names = names_of(o.names, o.num_names, "options.names");
  out.placement = placement_of(o.has_center != 0, o.center, o.scale, o.auto_frame != 0);
  out.crop = crop_of(o.crop);
  out.force = o.force != 0;
  if (o.view_count < 0 || o.view_count > max_views)
    fail(Status::usage, "{} is {}, the network takes 1 to {}", Option::view_count, o.view_count, max_views);
  if (o.view_count != 0 && o.num_names != 0)
    fail(Status::usage, "{} and {} are both set: give one of them", Option::view_count, Option::views);
  out.view_count = o.view_count;
  return out;
}

vsplat_status vsplat_input_prepare(vsplat_model model, vsplat_views views, const vsplat_input_options* options,
                                   vsplat_input* out_input) {
  return guarded([&] {
    need(model, "model");
    need(views, "views");
    need(out_input, "out_input");
    const InputRequest request = request_of(taken(options, VSPLAT_INPUT_OPTIONS_INIT, "options"));
    auto input = std::make_unique<vsplat_input_impl>();
    input->input = prepare_input(views->photographs, config_of(model).taken(), request);
    input->up = listed_up(views->photographs);
    *out_input = input.release();
  });
}

void vsplat_input_retain(vsplat_input input) { retain(input); }
void vsplat_input_release(vsplat_input input) { release(input); }

vsplat_status vsplat_input_get_info(vsplat_input input, vsplat_input_info* out_info) {
  return guarded([&] {
    need(input, "input");
    vsplat_input_info info = VSPLAT_INPUT_INFO_INIT;
    info.views = static_cast<int32_t>(input->input.views.size());
    info.image = input->input.views.front().image.width;
    for (int i = 0; i < 3; ++i) info.center[i] = input->input.placement.centre[i];
    info.scale = input->input.placement.edge;
    std::copy_n(input->up.data(), 3, info.up);
    give(out_info, info, "out_info");
  });
}

vsplat_status vsplat_input_get_camera(vsplat_input input, size_t index, vsplat_camera* out_camera) {
  return guarded([&] { give(out_camera, describe(view_at(input, index).camera), "out_camera"); });
}

vsplat_status vsplat_input_get_picture(vsplat_input input, size_t index, float* out_pixels, size_t capacity) {
  return guarded([&] {
    const Image& image = view_at(input, index).image;
    need(out_pixels, "out_pixels");
    if (capacity < image.data.size())
      fail(Status::usage, "capacity is {} floats: the picture has {}", capacity, image.data.size());
    std::copy(image.data.begin(), image.data.end(), out_pixels);
  });
}

vsplat_status vsplat_input_get_files(vsplat_input input, const char* folder, char** out_text) {
  return guarded([&] {
    need(input, "input");
    need(folder, "folder");
    need(out_text, "out_text");
    std::string text;
    for (const std::string& file : written_view_files(folder, input->input.views)) text += file + "\n";
    *out_text = new_text(text);
  });
}

vsplat_status vsplat_input_save(vsplat_input input, const char* folder) {
  return guarded([&] {
    need(input, "input");
    need(folder, "folder");
    write_views(folder, input->input.views);
  });
}
