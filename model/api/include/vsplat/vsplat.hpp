// The C interface for C++17 and later: handles that release themselves, and vsplat::Error instead of statuses. Header
// only; all else (units, layouts, threads) is as vsplat.h says.
#ifndef VSPLAT_HPP
#define VSPLAT_HPP

#include <vsplat/vsplat.h>

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace vsplat {
inline namespace cxx {

class Error : public std::runtime_error {
 public:
  Error(vsplat_status status, const char* message) : std::runtime_error(message), status_(status) {}
  vsplat_status status() const noexcept { return status_; }

 private:
  vsplat_status status_;
};

inline void check(vsplat_status status) {
  if (status != VSPLAT_OK) throw Error(status, vsplat_last_error());
}

// Takes over what a call handed out.
inline std::string text(char* from) {
  std::string out(from);
  vsplat_text_free(from);
  return out;
}
// The lines of a text, each ended by a line feed.
inline std::vector<std::string> lines(const std::string& text) {
  std::vector<std::string> out(1);
  for (const char c : text) {
    if (c == '\n')
      out.emplace_back();
    else
      out.back() += c;
  }
  out.pop_back();
  return out;
}

// A counted reference; get() for the C functions.
template <class T, void (*Retain)(T), void (*Release)(T)>
class Handle {
 public:
  Handle() = default;
  explicit Handle(T owned) : handle_(owned) {}
  Handle(const Handle& other) : handle_(other.handle_) { Retain(handle_); }
  Handle(Handle&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  Handle& operator=(Handle other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~Handle() { Release(handle_); }

  T get() const { return handle_; }
  explicit operator bool() const { return handle_ != nullptr; }

 private:
  T handle_ = nullptr;
};

using DeviceHandle = Handle<vsplat_device, vsplat_device_retain, vsplat_device_release>;
using ModelHandle = Handle<vsplat_model, vsplat_model_retain, vsplat_model_release>;
using ViewsHandle = Handle<vsplat_views, vsplat_views_retain, vsplat_views_release>;
using InputHandle = Handle<vsplat_input, vsplat_input_retain, vsplat_input_release>;
using CamerasHandle = Handle<vsplat_cameras, vsplat_cameras_retain, vsplat_cameras_release>;
using SceneHandle = Handle<vsplat_scene, vsplat_scene_retain, vsplat_scene_release>;
using MeshHandle = Handle<vsplat_mesh, vsplat_mesh_retain, vsplat_mesh_release>;
using DataSetHandle = Handle<vsplat_dataset, vsplat_dataset_retain, vsplat_dataset_release>;
using SheetHandle = Handle<vsplat_sheet, vsplat_sheet_retain, vsplat_sheet_release>;
using AnimationHandle = Handle<vsplat_animation, vsplat_animation_retain, vsplat_animation_release>;

class Device : public DeviceHandle {
 public:
  Device() = default;
  using DeviceHandle::DeviceHandle;
  explicit Device(const vsplat_device_options& options) : DeviceHandle(open(options)) {}

  static std::vector<vsplat_device_info> list() {
    size_t count = 0;
    check(vsplat_device_count(&count));
    std::vector<vsplat_device_info> out(count, VSPLAT_DEVICE_INFO_INIT);
    for (size_t i = 0; i < count; ++i) check(vsplat_device_describe(i, &out[i]));
    return out;
  }
  vsplat_device_info info() const {
    vsplat_device_info out = VSPLAT_DEVICE_INFO_INIT;
    check(vsplat_device_get_info(get(), &out));
    return out;
  }
  // Of the same device, for another thread.
  Device stream() const {
    vsplat_device out = nullptr;
    check(vsplat_stream_create(get(), &out));
    return Device(out);
  }
  // Stops the call that has it; from any thread.
  void cancel() const { check(vsplat_device_cancel(get())); }
  void trim() { check(vsplat_device_trim(get())); }
  void profile(bool on) { check(vsplat_device_profile(get(), on)); }
  void profile_name(const std::string& what, const std::string& name) {
    check(vsplat_device_profile_name(get(), what.c_str(), name.c_str()));
  }
  std::string profile_text(vsplat_profile_format format) const {
    char* out = nullptr;
    check(vsplat_device_profile_text(get(), format, &out));
    return text(out);
  }
  // JSON. The model may be of nothing where the jobs take none.
  std::string programs(vsplat_model model, const vsplat_programs_options& options) const {
    char* out = nullptr;
    check(vsplat_device_programs(get(), model, &options, &out));
    return text(out);
  }
  // JSON of what a search for parameters found.
  std::string tune(vsplat_model model, const vsplat_tune_options& options) const {
    char* out = nullptr;
    check(vsplat_tune(get(), model, &options, &out));
    return text(out);
  }

 private:
  static vsplat_device open(const vsplat_device_options& options) {
    vsplat_device out = nullptr;
    check(vsplat_device_open(&options, &out));
    return out;
  }
};

class Model : public ModelHandle {
 public:
  Model() = default;
  using ModelHandle::ModelHandle;

  static Model init(const vsplat_model_options& options) {
    vsplat_model out = nullptr;
    check(vsplat_model_init(&options, &out));
    return Model(out);
  }
  static Model load(const std::string& path) {
    vsplat_model out = nullptr;
    check(vsplat_model_load(path.c_str(), &out));
    return Model(out);
  }
  // The one that the library carries.
  static Model load() {
    vsplat_model out = nullptr;
    check(vsplat_model_load(nullptr, &out));
    return Model(out);
  }
  // Of a PyTorch checkpoint; `told`, where it is given, becomes what vsplat_model_import tells as JSON.
  static Model imported(const std::string& path, const vsplat_import_options& options, std::string* told = nullptr) {
    vsplat_model out = nullptr;
    char* out_text = nullptr;
    check(vsplat_model_import(path.c_str(), &options, &out, told ? &out_text : nullptr));
    if (told) *told = text(out_text);
    return Model(out);
  }
  void save(const std::string& path, vsplat_dtype dtype = VSPLAT_DTYPE_F32) const {
    check(vsplat_model_save_as(get(), path.c_str(), dtype));
  }
  // The same with another number of views that an Input picks by default.
  Model with_use_views(int32_t use_views) const {
    vsplat_model out = nullptr;
    check(vsplat_model_with_use_views(get(), use_views, &out));
    return Model(out);
  }
  vsplat_model_info info() const {
    vsplat_model_info out = VSPLAT_MODEL_INFO_INIT;
    check(vsplat_model_get_info(get(), &out));
    return out;
  }
};

class Cameras : public CamerasHandle {
 public:
  Cameras() = default;
  using CamerasHandle::CamerasHandle;

  // `width` and `height`: for cameras whose file tells no size; 0: none.
  static Cameras load(const std::string& path, int width = 0, int height = 0) {
    vsplat_cameras out = nullptr;
    check(vsplat_cameras_load(path.c_str(), width, height, &out));
    return Cameras(out);
  }
  std::vector<vsplat_camera> all() const {
    size_t count = 0;
    check(vsplat_cameras_count(get(), &count));
    std::vector<vsplat_camera> out(count, VSPLAT_CAMERA_INIT);
    for (size_t i = 0; i < count; ++i) check(vsplat_cameras_get(get(), i, &out[i]));
    return out;
  }
  // A smooth path with these as its keys.
  Cameras path(int count) const {
    vsplat_cameras out = nullptr;
    check(vsplat_cameras_path(get(), count, &out));
    return Cameras(out);
  }
  // "" where there is none.
  std::string find_picture(size_t index, const std::string& folder) const {
    char* out = nullptr;
    check(vsplat_cameras_find_picture(get(), index, folder.c_str(), &out));
    return text(out);
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
  static Views create(const std::vector<vsplat_view>& views) {
    vsplat_views out = nullptr;
    check(vsplat_views_create(views.data(), views.size(), &out));
    return Views(out);
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
  Input(const Model& model, const Views& views, const vsplat_input_options& options)
      : InputHandle(prepare(model, views, options)) {}

  vsplat_input_info info() const {
    vsplat_input_info out = VSPLAT_INPUT_INFO_INIT;
    check(vsplat_input_get_info(get(), &out));
    return out;
  }
  // What save() would write.
  std::vector<std::string> files(const std::string& folder) const {
    char* out = nullptr;
    check(vsplat_input_get_files(get(), folder.c_str(), &out));
    return lines(text(out));
  }
  void save(const std::string& folder) const { check(vsplat_input_save(get(), folder.c_str())); }
  Cameras orbit(const vsplat_orbit_options& options) const {
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

// Gaussians, or derivatives by them, in memory of their own.
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
};

class Scene : public SceneHandle {
 public:
  Scene() = default;
  using SceneHandle::SceneHandle;

  static Scene load(const std::string& path) {
    vsplat_scene out = nullptr;
    check(vsplat_scene_load(path.c_str(), &out));
    return Scene(out);
  }
  static Scene load(const std::string& path, const vsplat_scene_load_options& options) {
    vsplat_scene out = nullptr;
    check(vsplat_scene_load_with(path.c_str(), &options, &out));
    return Scene(out);
  }
  // Near plane and mirror are those of `info`; the count is that of `gaussians`.
  static Scene create(Gaussians gaussians, int sh_degree, vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT) {
    vsplat_scene out = nullptr;
    const vsplat_gaussians arrays = gaussians.arrays();
    info.count = arrays.capacity;
    info.sh_degree = sh_degree;
    check(vsplat_scene_create(&info, &arrays, &out));
    return Scene(out);
  }
  void update(Gaussians gaussians) const {
    const vsplat_gaussians arrays = gaussians.arrays();
    check(vsplat_scene_update(get(), &arrays));
  }
  Gaussians gaussians() const {
    const vsplat_scene_info about = info();
    Gaussians out(about.count, about.sh_degree);
    const vsplat_gaussians arrays = out.arrays();
    check(vsplat_scene_get_gaussians(get(), &arrays));
    return out;
  }
  void save(const std::string& path) const { check(vsplat_scene_save(get(), path.c_str())); }
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
  Cameras orbit(const vsplat_orbit_options& options) const {
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

// What was drawn, in memory of its own.
struct Picture {
  int width = 0, height = 0;
  std::vector<float> colour, alpha, depth;  // [height][width][3], [height][width], [height][width]

  vsplat_picture arrays() {
    vsplat_picture out = VSPLAT_PICTURE_INIT;
    out.capacity = alpha.size();
    out.colour = colour.data();
    out.alpha = alpha.data();
    out.depth = depth.data();
    return out;
  }
  void save(const std::string& path, vsplat_picture_format format) {
    const vsplat_picture p = arrays();
    check(vsplat_picture_save(&p, width, height, format, path.c_str()));
  }
  void save_jpeg(const std::string& path, int quality) {
    const vsplat_picture p = arrays();
    check(vsplat_picture_save_jpeg(&p, width, height, quality, path.c_str()));
  }
};

class Mesh : public MeshHandle {
 public:
  using MeshHandle::MeshHandle;
  // `texture` "": the file's own.
  static Mesh load(const std::string& path, const std::string& texture = "") {
    vsplat_mesh out = nullptr;
    check(vsplat_mesh_load(path.c_str(), texture.empty() ? nullptr : texture.c_str(), &out));
    return Mesh(out);
  }
  static Mesh procedural(uint64_t seed, uint32_t index) {
    vsplat_mesh out = nullptr;
    check(vsplat_mesh_procedural(seed, index, &out));
    return Mesh(out);
  }
  static Mesh procedural(const vsplat_mesh_procedural_options& options) {
    vsplat_mesh out = nullptr;
    check(vsplat_mesh_procedural_with(&options, &out));
    return Mesh(out);
  }
  vsplat_mesh_info info() const {
    vsplat_mesh_info out = VSPLAT_MESH_INFO_INIT;
    check(vsplat_mesh_get_info(get(), &out));
    return out;
  }
  void write_views(const std::string& folder, const vsplat_mesh_views_options& options) const {
    check(vsplat_mesh_write_views(get(), &options, folder.c_str()));
  }
};

class DataSet : public DataSetHandle {
 public:
  explicit DataSet(const std::vector<std::string>& paths) : DataSetHandle(open(paths)) {}

  size_t count() const {
    size_t out = 0;
    check(vsplat_dataset_count(get(), &out));
    return out;
  }
  // JSON: name, layout, path.
  std::string describe(size_t index) const {
    char* out = nullptr;
    check(vsplat_dataset_describe(get(), index, &out));
    return text(out);
  }
  // `bad`: a JSON list.
  vsplat_dataset_object survey(size_t index, int32_t pictures, std::string& bad) const {
    vsplat_dataset_object out = VSPLAT_DATASET_OBJECT_INIT;
    char* texts = nullptr;
    check(vsplat_dataset_survey(get(), index, pictures, &out, &texts));
    bad = text(texts);
    return out;
  }
  // [side][side][3], on white.
  std::vector<float> picture(size_t index, int32_t view, int32_t side) const {
    std::vector<float> out(static_cast<size_t>(side) * static_cast<size_t>(side) * 3);
    check(vsplat_dataset_get_picture(get(), index, view, side, out.data(), out.size()));
    return out;
  }

 private:
  static vsplat_dataset open(const std::vector<std::string>& paths) {
    std::vector<const char*> names;
    names.reserve(paths.size());
    for (const std::string& path : paths) names.push_back(path.c_str());
    vsplat_dataset out = nullptr;
    check(vsplat_dataset_open(names.data(), names.size(), &out));
    return out;
  }
};

class Sheet : public SheetHandle {
 public:
  Sheet() = default;
  explicit Sheet(const vsplat_sheet_options& options) : SheetHandle(create(options)) {}

  void add(Picture& picture, const std::string& label = "") {
    const vsplat_picture p = picture.arrays();
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

  void add(Picture& picture) {
    const vsplat_picture p = picture.arrays();
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

inline Picture render(const Device& device, const Scene& scene, const vsplat_camera& camera,
                      const vsplat_render_options& options = VSPLAT_RENDER_OPTIONS_INIT) {
  Picture out;
  out.width = camera.width;
  out.height = camera.height;
  const size_t pixels = camera.width > 0 && camera.height > 0
                            ? static_cast<size_t>(camera.width) * static_cast<size_t>(camera.height)
                            : 0;
  out.colour.resize(3 * pixels);
  out.alpha.resize(pixels);
  out.depth.resize(pixels);
  const vsplat_picture p = out.arrays();
  check(vsplat_render(device.get(), scene.get(), &camera, &options, &p));
  return out;
}

// Derivatives of a loss on a picture.
struct Gradient {
  Gaussians gaussians;
  double pose[6] = {};  // see vsplat_render_backward
};

// `by_picture` holds the loss's derivatives by the picture's values.
inline Gradient render_backward(const Device& device, const Scene& scene, const vsplat_camera& camera,
                                Picture by_picture, const vsplat_render_options& options = VSPLAT_RENDER_OPTIONS_INIT) {
  const vsplat_scene_info about = scene.info();
  Gradient out{Gaussians(about.count, about.sh_degree)};
  const vsplat_picture p = by_picture.arrays();
  const vsplat_gaussians arrays = out.gaussians.arrays();
  check(vsplat_render_backward(device.get(), scene.get(), &camera, &options, &p, &arrays, out.pose));
  return out;
}

// Training, see vsplat/train.h. The configuration with every field, from one with some or, where it is empty, none.
inline std::string train_config(const std::string& config = "") {
  char* out = nullptr;
  check(vsplat_train_config(config.empty() ? nullptr : config.c_str(), &out));
  return text(out);
}
inline vsplat_plan train_plan(const Device& device, const std::string& config,
                              const vsplat_train_plan_options& options = VSPLAT_TRAIN_PLAN_OPTIONS_INIT) {
  vsplat_plan out = VSPLAT_PLAN_INIT;
  check(vsplat_train_plan(device.get(), config.c_str(), &options, &out));
  return out;
}
inline vsplat_train_result train(const Device& device, const std::string& config, const vsplat_train_options& options) {
  vsplat_train_result out = VSPLAT_TRAIN_RESULT_INIT;
  check(vsplat_train(device.get(), config.c_str(), &options, &out));
  return out;
}
inline void train_report(const std::vector<std::string>& runs, const std::string& path) {
  std::vector<const char*> paths;
  for (const std::string& run : runs) paths.push_back(run.c_str());
  check(vsplat_train_report(paths.data(), paths.size(), path.c_str()));
}

}  // namespace cxx
}  // namespace vsplat

#include <vsplat/evaluate.hpp>
#include <vsplat/refine.hpp>
#include <vsplat/share.hpp>

#endif
