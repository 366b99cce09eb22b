// Devices and models for C++. Part of vsplat.hpp, which includes it.
#ifndef VSPLAT_DEVICE_HPP
#define VSPLAT_DEVICE_HPP

#include <vsplat/vsplat.h>

#include <string>
#include <vector>
#include <vsplat/handle.hpp>
#include <vsplat/spans.hpp>

namespace vsplat {
inline namespace cxx {

using DeviceHandle = Handle<vsplat_device, vsplat_device_retain, vsplat_device_release>;
using ModelHandle = Handle<vsplat_model, vsplat_model_retain, vsplat_model_release>;

class Device : public DeviceHandle {
 public:
  Device() = default;
  using DeviceHandle::DeviceHandle;
  explicit Device(const vsplat_device_options& options) : DeviceHandle(opened(options)) {}
  // Device() is an empty handle.
  static Device open(const vsplat_device_options& options = VSPLAT_DEVICE_OPTIONS_INIT) { return Device(options); }

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
  // A stream of the same device, for another thread.
  Device stream() const {
    vsplat_device out = nullptr;
    check(vsplat_stream_create(get(), &out));
    return Device(out);
  }
  // Stops the call that is using the device; callable from any thread.
  void cancel() const { check(vsplat_device_cancel(get())); }
  void trim() { check(vsplat_device_trim(get())); }
  void profile(bool on) { check(vsplat_device_profile(get(), on)); }
  void profile_name(const std::string& what, const std::string& name) {
    check(vsplat_device_profile_name(get(), what.c_str(), name.c_str()));
  }
  // Sorted by time, longest first.
  std::vector<vsplat_profile_row> profile_rows() const {
    size_t count = 0;
    check(vsplat_device_profile_count(get(), &count));
    std::vector<vsplat_profile_row> out(count, VSPLAT_PROFILE_ROW_INIT);
    for (size_t i = 0; i < count; ++i) check(vsplat_device_profile_get(get(), i, &out[i]));
    return out;
  }
  std::string profile_text(vsplat_profile_format format) const {
    char* out = nullptr;
    check(vsplat_device_profile_text(get(), format, &out));
    return text(out);
  }
  // Returns JSON. The model may be NULL if no job needs one.
  std::string programs(vsplat_model model, const vsplat_programs_options& options) const {
    char* out = nullptr;
    check(vsplat_device_programs(get(), model, &options, &out));
    return text(out);
  }
  // Returns the search's report as JSON.
  std::string tune(vsplat_model model, const vsplat_tune_options& options) const {
    char* out = nullptr;
    check(vsplat_tune(get(), model, &options, &out));
    return text(out);
  }

 private:
  static vsplat_device opened(const vsplat_device_options& options) {
    vsplat_device out = nullptr;
    check(vsplat_device_open(&options, &out));
    return out;
  }
};

// Returns the report as JSON, and the verdict in `fitness`.
inline std::string selftest(const vsplat_selftest_options& options, vsplat_fitness& fitness) {
  char* out = nullptr;
  check(vsplat_selftest(&options, &fitness, &out));
  return text(out);
}

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
  // Loads a model from the bytes of a model file.
  static Model load(Span<const unsigned char> bytes) {
    vsplat_model out = nullptr;
    check(vsplat_model_load_memory(bytes.data(), bytes.size(), &out));
    return Model(out);
  }
  // Loads the model built into the library.
  static Model load() {
    vsplat_model out = nullptr;
    check(vsplat_model_load(nullptr, &out));
    return Model(out);
  }
  // Imports a PyTorch checkpoint. `report`, unless it is null, receives the JSON report of vsplat_model_import.
  static Model imported(const std::string& path, const vsplat_import_options& options, std::string* report = nullptr) {
    vsplat_model out = nullptr;
    char* out_text = nullptr;
    check(vsplat_model_import(path.c_str(), &options, &out, report ? &out_text : nullptr));
    if (report) *report = text(out_text);
    return Model(out);
  }
  void save(const std::string& path, vsplat_dtype dtype = VSPLAT_DTYPE_F32) const {
    check(vsplat_model_save_as(get(), path.c_str(), dtype));
  }
  // The bytes of the model file.
  std::vector<unsigned char> save_memory(vsplat_dtype dtype = VSPLAT_DTYPE_F32) const {
    char* out = nullptr;
    size_t size = 0;
    check(vsplat_model_save_memory(get(), dtype, &out, &size));
    return bytes(out, size);
  }
  // Returns the same model with another number of views that an Input picks by default.
  Model with_use_views(int32_t use_views) const {
    vsplat_model out = nullptr;
    check(vsplat_model_with_use_views(get(), use_views, &out));
    return Model(out);
  }
  // Returns the same model with other defaults of a reconstruction, as vsplat_model_with_passes.
  Model with_passes(int32_t passes, double merge_cell, int32_t fit_epochs) const {
    vsplat_model out = nullptr;
    check(vsplat_model_with_passes(get(), passes, merge_cell, fit_epochs, &out));
    return Model(out);
  }
  vsplat_model_info info() const {
    vsplat_model_info out = VSPLAT_MODEL_INFO_INIT;
    check(vsplat_model_get_info(get(), &out));
    return out;
  }
};

}  // namespace cxx
}  // namespace vsplat

#endif
