// The C interface for C++17 and later: handles that release themselves, and vsplat::Error instead of statuses. Header
// only. Everything else (units, layouts, threads) is as described in vsplat.h.
#ifndef VSPLAT_HPP
#define VSPLAT_HPP

#include <vsplat/vsplat.h>

#include <cmath>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>
#include <vsplat/callbacks.hpp>
#include <vsplat/device.hpp>
#include <vsplat/handle.hpp>
#include <vsplat/spans.hpp>

namespace vsplat {
inline namespace cxx {

using ViewsHandle = Handle<vsplat_views, vsplat_views_retain, vsplat_views_release>;
using InputHandle = Handle<vsplat_input, vsplat_input_retain, vsplat_input_release>;
using CamerasHandle = Handle<vsplat_cameras, vsplat_cameras_retain, vsplat_cameras_release>;
using SceneHandle = Handle<vsplat_scene, vsplat_scene_retain, vsplat_scene_release>;

// Returns a camera at `eye`, see vsplat_camera_look_at; `degrees` is the field of view across the width.
inline vsplat_camera looking_at(const double (&eye)[3], const double (&target)[3], const double (&up)[3], int32_t width,
                                int32_t height, double degrees = 50) {
  vsplat_camera out = VSPLAT_CAMERA_INIT;
  out.width = width, out.height = height;
  out.cx = width / 2.0, out.cy = height / 2.0;
  out.fx = out.fy = out.cx / std::tan(degrees * 3.14159265358979323846 / 360);
  check(vsplat_camera_look_at(eye, target, up, &out));
  return out;
}

class Cameras : public CamerasHandle {
 public:
  Cameras() = default;
  using CamerasHandle::CamerasHandle;

  // `width` and `height`: the size for cameras whose file gives none; 0: none.
  static Cameras load(const std::string& path, int width = 0, int height = 0) {
    vsplat_cameras out = nullptr;
    check(vsplat_cameras_load(path.c_str(), width, height, &out));
    return Cameras(out);
  }
  static Cameras create(Span<const vsplat_camera> cameras) {
    vsplat_cameras out = nullptr;
    check(vsplat_cameras_create(cameras.data(), cameras.size(), &out));
    return Cameras(out);
  }
  static Cameras load(const std::string& path, const vsplat_cameras_options& options) {
    vsplat_cameras out = nullptr;
    check(vsplat_cameras_load_with(path.c_str(), &options, &out));
    return Cameras(out);
  }
  // Writes a cameras.json.
  void save(const std::string& path) const {
    const std::vector<vsplat_camera> cameras = all();
    check(vsplat_cameras_save(cameras.data(), cameras.size(), nullptr, path.c_str()));
  }
  std::vector<vsplat_camera> all() const {
    size_t count = 0;
    check(vsplat_cameras_count(get(), &count));
    std::vector<vsplat_camera> out(count, VSPLAT_CAMERA_INIT);
    for (size_t i = 0; i < count; ++i) check(vsplat_cameras_get(get(), i, &out[i]));
    return out;
  }
  // A smooth path with these cameras as its keys.
  Cameras path(int count) const {
    vsplat_cameras out = nullptr;
    check(vsplat_cameras_path(get(), count, &out));
    return Cameras(out);
  }
  // Returns "" if there is none. `folder` "": where the list's own pictures are.
  std::string find_picture(size_t index, const std::string& folder = "") const {
    char* out = nullptr;
    check(vsplat_cameras_find_picture(get(), index, folder.empty() ? nullptr : folder.c_str(), &out));
    return text(out);
  }
  // The size as the camera saw the picture.
  void picture_size(size_t index, const std::string& path, int32_t& width, int32_t& height) const {
    check(vsplat_cameras_get_picture_size(get(), index, path.c_str(), &width, &height));
  }
  // [height][width][3]
  std::vector<float> load_picture(size_t index, const std::string& path, int width, int height,
                                  const float (&background)[3]) const {
    std::vector<float> out(3 * static_cast<size_t>(width) * static_cast<size_t>(height));
    check(vsplat_cameras_load_picture(get(), index, path.c_str(), width, height, background, out.data(), out.size()));
    return out;
  }
};

class Views : public ViewsHandle {
 public:
  Views() = default;
  using ViewsHandle::ViewsHandle;

  static Views load(const std::string& path, const std::string& pictures = "") {
    vsplat_views out = nullptr;
    check(vsplat_views_load(path.c_str(), pictures.empty() ? nullptr : pictures.c_str(), &out));
    return Views(out);
  }
  static Views load(const std::string& path, const vsplat_views_options& options) {
    vsplat_views out = nullptr;
    check(vsplat_views_load_with(path.c_str(), &options, &out));
    return Views(out);
  }
  static Views create(Span<const vsplat_view> views) {
    vsplat_views out = nullptr;
    check(vsplat_views_create(views.data(), views.size(), &out));
    return Views(out);
  }
  static Views create(std::initializer_list<vsplat_view> views) {
    return create(Span<const vsplat_view>(views.begin(), views.size()));
  }
  size_t size() const {
    size_t out = 0;
    check(vsplat_views_count(get(), &out));
    return out;
  }
  std::string name(size_t index) const {
    char* out = nullptr;
    check(vsplat_views_get_name(get(), index, &out));
    return text(out);
  }
  std::vector<std::string> files() const {
    char* out = nullptr;
    check(vsplat_views_get_files(get(), &out));
    return lines(text(out));
  }
};

class Input : public InputHandle {
 public:
  Input() = default;
  Input(const Model& model, const Views& views, const vsplat_input_options& options = VSPLAT_INPUT_OPTIONS_INIT)
      : InputHandle(prepare(model, views, options)) {}

  vsplat_input_info info() const {
    vsplat_input_info out = VSPLAT_INPUT_INFO_INIT;
    check(vsplat_input_get_info(get(), &out));
    return out;
  }
  vsplat_camera camera(size_t index) const {
    vsplat_camera out = VSPLAT_CAMERA_INIT;
    check(vsplat_input_get_camera(get(), index, &out));
    return out;
  }
  // [image][image][3]
  std::vector<float> picture(size_t index) const {
    const auto edge = static_cast<size_t>(info().image);
    std::vector<float> out(3 * edge * edge);
    check(vsplat_input_get_picture(get(), index, out.data(), out.size()));
    return out;
  }
  // The files that save() would write.
  std::vector<std::string> files(const std::string& folder) const {
    char* out = nullptr;
    check(vsplat_input_get_files(get(), folder.c_str(), &out));
    return lines(text(out));
  }
  void save(const std::string& folder) const { check(vsplat_input_save(get(), folder.c_str())); }
  Cameras orbit(const vsplat_orbit_options& options = VSPLAT_ORBIT_OPTIONS_INIT) const {
    vsplat_cameras out = nullptr;
    check(vsplat_cameras_orbit_input(get(), &options, &out));
    return Cameras(out);
  }

 private:
  static vsplat_input prepare(const Model& model, const Views& views, const vsplat_input_options& options) {
    vsplat_input out = nullptr;
    check(vsplat_input_prepare(model.get(), views.get(), &options, &out));
    return out;
  }
};

// Gaussians, or derivatives by them, with their own memory.
struct Gaussians {
  std::vector<float> means, scales, rotations, opacities, sh;  // [K][3], [K][3], [K][4], [K], [K][S][3]

  Gaussians() = default;
  Gaussians(size_t count, int sh_degree)
      : means(3 * count),
        scales(3 * count),
        rotations(4 * count),
        opacities(count),
        sh(3 * count * static_cast<size_t>((sh_degree + 1) * (sh_degree + 1))) {}

  vsplat_gaussians arrays() {
    vsplat_gaussians out = VSPLAT_GAUSSIANS_INIT;
    out.capacity = opacities.size();
    out.means = means.data();
    out.scales = scales.data();
    out.rotations = rotations.data();
    out.opacities = opacities.data();
    out.sh = sh.data();
    return out;
  }
  operator GaussianSpans() { return {means, scales, rotations, opacities, sh}; }
  operator ConstGaussianSpans() const { return {means, scales, rotations, opacities, sh}; }
};

// The formats of scene files.
inline std::vector<vsplat_scene_format> scene_formats() {
  std::vector<vsplat_scene_format> out(vsplat_scene_format_count(), vsplat_scene_format VSPLAT_SCENE_FORMAT_INIT);
  for (size_t i = 0; i < out.size(); ++i) check(vsplat_scene_format_get(i, &out[i]));
  return out;
}

class Scene : public SceneHandle {
 public:
  Scene() = default;
  using SceneHandle::SceneHandle;

  static Scene load(const std::string& path) {
    vsplat_scene out = nullptr;
    check(vsplat_scene_load(path.c_str(), &out));
    return Scene(out);
  }
  // Reads a scene from a file's bytes, in any format.
  static Scene load(Span<const unsigned char> bytes,
                    const vsplat_scene_load_options& options = VSPLAT_SCENE_LOAD_OPTIONS_INIT) {
    vsplat_scene out = nullptr;
    check(vsplat_scene_load_memory(bytes.data(), bytes.size(), &options, &out));
    return Scene(out);
  }
  static Scene load(const std::string& path, const vsplat_scene_load_options& options) {
    vsplat_scene out = nullptr;
    check(vsplat_scene_load_with(path.c_str(), &options, &out));
    return Scene(out);
  }
  // Makes a scene of as many Gaussians as `gaussians` has opacities; the values are copied. Near plane, mirror and the
  // rest come from `info`.
  static Scene create(const ConstGaussianSpans& gaussians, int sh_degree,
                      vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT) {
    vsplat_scene out = nullptr;
    info.count = gaussians.opacities.size();
    info.sh_degree = sh_degree;
    const vsplat_gaussians arrays = gaussians.arrays(info.count, sh_degree);
    check(vsplat_scene_create(&info, &arrays, &out));
    return Scene(out);
  }
  // Empty spans leave their values unchanged.
  void update(const ConstGaussianSpans& gaussians) const {
    const vsplat_scene_info about = info();
    const vsplat_gaussians arrays = gaussians.arrays(about.count, about.sh_degree);
    check(vsplat_scene_update(get(), &arrays));
  }
  // Copies the Gaussians to the caller's memory; empty spans are not wanted.
  void read(const GaussianSpans& into) const {
    const vsplat_scene_info about = info();
    const vsplat_gaussians arrays = into.arrays(about.count, about.sh_degree);
    check(vsplat_scene_get_gaussians(get(), &arrays));
  }
  Gaussians gaussians() const {
    const vsplat_scene_info about = info();
    Gaussians out(about.count, about.sh_degree);
    const vsplat_gaussians arrays = out.arrays();
    check(vsplat_scene_get_gaussians(get(), &arrays));
    return out;
  }
  // Changes of this scene, and of every other handle to it; see vsplat_scene_append. A transform is [4][4], row by row.
  void append(const Scene& other) { check(vsplat_scene_append(get(), other.get(), nullptr)); }
  void append(const Scene& other, const double (&transform)[16]) {
    check(vsplat_scene_append(get(), other.get(), transform));
  }
  void transform(const double (&transform)[16]) { check(vsplat_scene_transform(get(), transform)); }
  // `removed` has a value for each Gaussian; those that are not 0 mark the Gaussians to remove.
  void remove(Span<const uint8_t> removed) { check(vsplat_scene_remove(get(), removed.data(), removed.size())); }
  void crop(const double (&low)[3], const double (&high)[3]) { check(vsplat_scene_crop(get(), low, high)); }
  // Writes the format of the path's ending, or that of the options.
  void save(const std::string& path, const vsplat_scene_save_options& options = VSPLAT_SCENE_SAVE_OPTIONS_INIT) const {
    check(vsplat_scene_save_with(get(), path.c_str(), &options));
  }
  // The bytes that save() would write; a PLY unless the options name another format.
  std::vector<unsigned char> save_memory(
      const vsplat_scene_save_options& options = VSPLAT_SCENE_SAVE_OPTIONS_INIT) const {
    char* out = nullptr;
    size_t size = 0;
    check(vsplat_scene_save_memory_with(get(), &options, &out, &size));
    return bytes(out, size);
  }
  // What a file in that format would lose of this scene, a sentence a line.
  std::string losses(const std::string& format) const {
    char* out = nullptr;
    check(vsplat_scene_get_losses(get(), format.c_str(), &out));
    return text(out);
  }
  Scene surfels_to_gaussians(double thickness) const {
    vsplat_scene out = nullptr;
    check(vsplat_scene_surfels_to_gaussians(get(), thickness, &out));
    return Scene(out);
  }
  vsplat_scene_info info() const {
    vsplat_scene_info out = VSPLAT_SCENE_INFO_INIT;
    check(vsplat_scene_get_info(get(), &out));
    return out;
  }
  std::vector<int32_t> selection() const {
    size_t count = 0;
    check(vsplat_scene_get_selection(get(), nullptr, 0, &count));
    std::vector<int32_t> out(count);
    check(vsplat_scene_get_selection(get(), out.data(), out.size(), &count));
    return out;
  }
  Cameras orbit(const vsplat_orbit_options& options = VSPLAT_ORBIT_OPTIONS_INIT) const {
    vsplat_cameras out = nullptr;
    check(vsplat_cameras_orbit_scene(get(), &options, &out));
    return Cameras(out);
  }
};

inline Scene reconstruct(const Device& device, const Model& model, const Input& input,
                         const vsplat_reconstruct_options& options = VSPLAT_RECONSTRUCT_OPTIONS_INIT) {
  vsplat_scene out = nullptr;
  check(vsplat_reconstruct(device.get(), model.get(), input.get(), &options, &out));
  return Scene(out);
}
inline Scene reconstruct(const Device& device, const Model& model, const Input& input,
                         const vsplat_reconstruct_options& options, const Progress& progress) {
  detail::ProgressCall call(progress);
  const vsplat_reconstruct_options complete = call.of(options);
  vsplat_scene out = nullptr;
  call.check(vsplat_reconstruct(device.get(), model.get(), input.get(), &complete, &out));
  return Scene(out);
}

inline Scene reconstruct(const Device& device, const Model& model, const Input& input, const Progress& progress) {
  return reconstruct(device, model, input, VSPLAT_RECONSTRUCT_OPTIONS_INIT, progress);
}

// Does in advance what the first reconstruction with the model would do once.
inline void prepare(const Device& device, const Model& model,
                    const vsplat_prepare_options& options = VSPLAT_PREPARE_OPTIONS_INIT,
                    const Progress& progress = {}) {
  detail::ProgressCall call(progress);
  const vsplat_prepare_options complete = call.of(options);
  call.check(vsplat_device_prepare(device.get(), model.get(), &complete));
}

// A drawn picture, with its own memory.
struct Picture {
  int width = 0, height = 0;
  std::vector<float> colour, alpha, depth;  // [height][width][3], [height][width], [height][width]
  // vsplat_picture's surface maps, after add_surfaces(): `normal` [height][width][3], the others [height][width].
  std::vector<float> expected, median, normal;
  std::vector<int32_t> ids;

  Picture() = default;
  Picture(int with_width, int with_height) : width(with_width), height(with_height) {
    colour.resize(3 * pixels());
    alpha.resize(pixels());
    depth.resize(pixels());
  }
  // Also draws the surface maps below. Surfels have no ids.
  Picture& add_surfaces(bool with_ids = true) {
    expected.resize(pixels());
    median.resize(pixels());
    normal.resize(3 * pixels());
    if (with_ids) ids.resize(pixels());
    return *this;
  }

  operator PictureSpans() { return {colour, alpha, depth, expected, median, normal, ids}; }
  operator ConstPictureSpans() const { return {colour, alpha, depth, expected, median, normal, ids}; }
  vsplat_picture arrays() { return PictureSpans(*this).arrays(width, height); }
  void save(const std::string& path, vsplat_picture_format format) const {
    const vsplat_picture p = ConstPictureSpans(*this).arrays(width, height);
    check(vsplat_picture_save(&p, width, height, format, path.c_str()));
  }
  void save_jpeg(const std::string& path, int quality) const {
    const vsplat_picture p = ConstPictureSpans(*this).arrays(width, height);
    check(vsplat_picture_save_jpeg(&p, width, height, quality, path.c_str()));
  }
  // The bytes that save() would write.
  std::vector<unsigned char> save_memory(vsplat_picture_format format) const {
    const vsplat_picture p = ConstPictureSpans(*this).arrays(width, height);
    char* out = nullptr;
    size_t size = 0;
    check(vsplat_picture_save_memory(&p, width, height, format, &out, &size));
    return bytes(out, size);
  }

 private:
  size_t pixels() const {
    return width > 0 && height > 0 ? static_cast<size_t>(width) * static_cast<size_t>(height) : 0;
  }
};

// Draws into the caller's memory; planes with empty spans are not computed.
inline void render(const Device& device, const Scene& scene, const vsplat_camera& camera, const PictureSpans& into,
                   const vsplat_render_options& options = VSPLAT_RENDER_OPTIONS_INIT) {
  const vsplat_picture p = into.arrays(camera.width, camera.height);
  check(vsplat_render(device.get(), scene.get(), &camera, &options, &p));
}
inline Picture render(const Device& device, const Scene& scene, const vsplat_camera& camera,
                      const vsplat_render_options& options = VSPLAT_RENDER_OPTIONS_INIT) {
  Picture out(camera.width, camera.height);
  render(device, scene, camera, out, options);
  return out;
}
// Draws into rows of 8-bit pixels of 3 or 4 channels, `row_bytes` apart (0: without gaps), as in vsplat_picture.data.
inline void render_bytes(const Device& device, const Scene& scene, const vsplat_camera& camera,
                         Span<unsigned char> into, int channels, size_t row_bytes = 0, bool premultiplied = false,
                         const vsplat_render_options& options = VSPLAT_RENDER_OPTIONS_INIT) {
  vsplat_picture p = VSPLAT_PICTURE_INIT;
  p.data = into.data();
  p.data_bytes = into.size();
  p.type = VSPLAT_PIXELS_U8;
  p.channels = channels;
  p.row_bytes = row_bytes;
  p.premultiplied = premultiplied ? 1 : 0;
  check(vsplat_render(device.get(), scene.get(), &camera, &options, &p));
}

namespace detail {

inline std::vector<vsplat_picture> arrays_of(Span<const vsplat_camera> cameras, Span<const PictureSpans> pictures) {
  if (cameras.size() != pictures.size())
    throw Error(VSPLAT_ERROR_USAGE, (std::to_string(cameras.size()) + " cameras and " +
                                     std::to_string(pictures.size()) + " pictures; one for each is expected")
                                        .c_str());
  std::vector<vsplat_picture> out;
  out.reserve(cameras.size());
  for (size_t i = 0; i < cameras.size(); ++i) out.push_back(pictures[i].arrays(cameras[i].width, cameras[i].height));
  return out;
}

}  // namespace detail

// Draws the pictures one after the other; progress is reported before each.
inline void render(const Device& device, const Scene& scene, Span<const vsplat_camera> cameras,
                   Span<const PictureSpans> into, const vsplat_render_options& options = VSPLAT_RENDER_OPTIONS_INIT,
                   const Progress& progress = {}) {
  const std::vector<vsplat_picture> arrays = detail::arrays_of(cameras, into);
  detail::ProgressCall call(progress);
  const vsplat_render_options complete = call.of(options);
  call.check(vsplat_render_views(device.get(), scene.get(), cameras.data(), cameras.size(), &complete, arrays.data()));
}

// Derivatives of a loss on a picture.
struct Gradient {
  Gaussians gaussians;
  double pose[6] = {};  // see vsplat_render_backward
};

// `by_picture` holds the loss's derivatives by the picture's values; empty spans count as zeros. Writes to the caller's
// memory; empty spans are not wanted. `pose`, unless empty, receives six values.
inline void render_backward(const Device& device, const Scene& scene, const vsplat_camera& camera,
                            const ConstPictureSpans& by_picture, const GaussianSpans& into, Span<double> pose,
                            const vsplat_render_options& options = VSPLAT_RENDER_OPTIONS_INIT) {
  const vsplat_scene_info about = scene.info();
  const vsplat_picture p = by_picture.arrays(camera.width, camera.height);
  const vsplat_gaussians arrays = into.arrays(about.count, about.sh_degree);
  check(vsplat_render_backward(device.get(), scene.get(), &camera, &options, &p, &arrays,
                               detail::pointer(pose, pose.empty() ? 0 : 6, "pose")));
}
inline Gradient render_backward(const Device& device, const Scene& scene, const vsplat_camera& camera,
                                const ConstPictureSpans& by_picture,
                                const vsplat_render_options& options = VSPLAT_RENDER_OPTIONS_INIT) {
  const vsplat_scene_info about = scene.info();
  Gradient out{Gaussians(about.count, about.sh_degree)};
  render_backward(device, scene, camera, by_picture, out.gaussians, out.pose, options);
  return out;
}

}  // namespace cxx
}  // namespace vsplat

#include <vsplat/dataset.hpp>
#include <vsplat/doctor.hpp>
#include <vsplat/evaluate.hpp>
#include <vsplat/fit.hpp>
#include <vsplat/jobs.hpp>
#include <vsplat/mesh.hpp>
#include <vsplat/pictures.hpp>
#include <vsplat/scene_edit.hpp>
#include <vsplat/share.hpp>
#include <vsplat/train.hpp>

#endif
