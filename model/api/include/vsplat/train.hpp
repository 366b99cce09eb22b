// Training for C++, see vsplat/train.h. Part of vsplat.hpp, which includes this file.
#ifndef VSPLAT_TRAIN_HPP
#define VSPLAT_TRAIN_HPP

#include <functional>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

namespace vsplat {
inline namespace cxx {

// The configuration with every field, from one with some fields, or with none if it is empty.
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

// Functions called during a training; any may be empty. If one throws, a checkpoint is written, the training ends, and
// train() rethrows the exception.
struct TrainFunctions {
  std::function<void(const vsplat_train_progress&)> progress;
  std::function<void(const char* text)> message;
  std::function<bool()> go_on;
};

namespace detail {

struct TrainCalls {
  const TrainFunctions& functions;
  Caught caught;

  static void on_progress(void* user, const vsplat_train_progress* progress) {
    auto* self = static_cast<TrainCalls*>(user);
    if (self->functions.progress) self->caught.run([&] { self->functions.progress(*progress); });
  }
  static void on_message(void* user, const char* text) {
    auto* self = static_cast<TrainCalls*>(user);
    if (self->functions.message) self->caught.run([&] { self->functions.message(text); });
  }
  static int32_t go_on(void* user) {
    auto* self = static_cast<TrainCalls*>(user);
    bool on = true;
    if (self->functions.go_on) self->caught.run([&] { on = self->functions.go_on(); });
    return on && !self->caught.any() ? 1 : 0;
  }
};

}  // namespace detail

inline vsplat_train_result train(const Device& device, const std::string& config, const vsplat_train_options& options) {
  vsplat_train_result out = VSPLAT_TRAIN_RESULT_INIT;
  check(vsplat_train(device.get(), config.c_str(), &options, &out));
  return out;
}
// Trains with lambdas in place of the options' functions.
inline vsplat_train_result train(const Device& device, const std::string& config, vsplat_train_options options,
                                 const TrainFunctions& functions) {
  detail::TrainCalls calls{functions, {}};
  options.on_progress = detail::TrainCalls::on_progress;
  options.on_message = detail::TrainCalls::on_message;
  options.go_on = detail::TrainCalls::go_on;
  options.user = &calls;
  vsplat_train_result out = VSPLAT_TRAIN_RESULT_INIT;
  calls.caught.check(vsplat_train(device.get(), config.c_str(), &options, &out));
  return out;
}

inline void train_report(const std::vector<std::string>& runs, const std::string& path) {
  std::vector<const char*> paths;
  paths.reserve(runs.size());
  for (const std::string& run : runs) paths.push_back(run.c_str());
  check(vsplat_train_report(paths.data(), paths.size(), path.c_str()));
}

}  // namespace cxx
}  // namespace vsplat

#endif
