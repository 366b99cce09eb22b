// Evaluations for C++. Part of vsplat.hpp, which includes this file.
#ifndef VSPLAT_EVALUATE_HPP
#define VSPLAT_EVALUATE_HPP

#include <vsplat/vsplat.hpp>

namespace vsplat {
inline namespace cxx {

using EvaluationHandle = Handle<vsplat_evaluation, vsplat_evaluation_retain, vsplat_evaluation_release>;

class Evaluation : public EvaluationHandle {
 public:
  Evaluation(const Device& device, const Model& model, const DataSet& data,
             const vsplat_evaluate_options& options = VSPLAT_EVALUATE_OPTIONS_INIT)
      : EvaluationHandle(run(device, model, data, options)) {}
  // `progress` replaces the options' functions: its "stage" is the object's name.
  Evaluation(const Device& device, const Model& model, const DataSet& data, vsplat_evaluate_options options,
             const Progress& progress) {
    detail::ProgressCall call(progress);
    options.on_object = nullptr;
    options = call.of(options);
    vsplat_evaluation out = nullptr;
    call.check(vsplat_evaluate(device.get(), model.get(), data.get(), &options, &out));
    static_cast<EvaluationHandle&>(*this) = EvaluationHandle(out);
  }

  struct Object {
    std::string name;
    vsplat_scores scores;
  };
  std::vector<Object> objects() const {
    size_t count = 0;
    check(vsplat_evaluation_count(get(), &count, nullptr));
    std::vector<Object> out(count, {"", VSPLAT_SCORES_INIT});
    for (size_t i = 0; i < count; ++i) {
      char* name = nullptr;
      check(vsplat_evaluation_get(get(), i, &name, &out[i].scores));
      out[i].name = text(name);
    }
    return out;
  }
  size_t skipped() const {
    size_t out = 0;
    check(vsplat_evaluation_count(get(), nullptr, &out));
    return out;
  }
  vsplat_scores mean() const {
    vsplat_scores out = VSPLAT_SCORES_INIT;
    check(vsplat_evaluation_get_mean(get(), &out));
    return out;
  }
  void save_sheet(const std::string& path) const { check(vsplat_evaluation_save_sheet(get(), path.c_str())); }

 private:
  static vsplat_evaluation run(const Device& device, const Model& model, const DataSet& data,
                               const vsplat_evaluate_options& options) {
    vsplat_evaluation out = nullptr;
    check(vsplat_evaluate(device.get(), model.get(), data.get(), &options, &out));
    return out;
  }
};

// Compares the scene's drawings with photographs; `on_picture` is called after each, and returns false to stop. It
// replaces the options' function. Returns the means.
inline vsplat_measured measure(const Device& device, const Scene& scene, const Views& views,
                               vsplat_measure_options options = VSPLAT_MEASURE_OPTIONS_INIT,
                               const std::function<bool(const vsplat_measured&)>& on_picture = {}) {
  struct Call {
    const std::function<bool(const vsplat_measured&)>& function;
    detail::Caught caught;
  } call{on_picture, {}};
  if (on_picture) {
    options.user = &call;
    options.on_picture = [](void* user, const vsplat_measured* picture) -> int32_t {
      auto* const self = static_cast<Call*>(user);
      bool on = false;
      self->caught.run([&] { on = self->function(*picture); });
      return on ? 1 : 0;
    };
  }
  vsplat_measured out = VSPLAT_MEASURED_INIT;
  call.caught.check(vsplat_scene_measure(device.get(), scene.get(), views.get(), &options, &out));
  return out;
}

// Returns the JSON of vsplat_model_check.
inline std::string check_model(const Device& device, const Model& model,
                               const vsplat_check_options& options = VSPLAT_CHECK_OPTIONS_INIT) {
  char* out = nullptr;
  check(vsplat_model_check(device.get(), model.get(), &options, &out));
  return text(out);
}

}  // namespace cxx
}  // namespace vsplat

#endif
