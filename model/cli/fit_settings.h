// What `vsplat fit` can be asked for: from the command line, from --settings, or from a list of `vsplat evaluate
// --scenes`. A new option is one in add_fit_settings(), and with a default that the library decides, one line in
// model/fit/scene_fit_settings.cpp.
#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "fit_job.h"
#include "placement_options.h"

namespace command {

struct FitSettings {
  PlacementOptions placement;
  FitOptions fit;
  std::string start = "auto", model, names, picture_folder, near;
  int view_count = 0;  // 0: the model's
  bool object = false, scene = false, force = false, skip_bad = false;
};

// Adds the options that say how a scene is fitted, and returns them.
std::vector<CLI::Option*> add_fit_settings(CLI::App& app, FitSettings& settings);

// The options by their names, without dashes: those given as they were, others null, or false for a flag.
nlohmann::ordered_json settings_in(const std::vector<CLI::Option*>& options);

// The options that a file's fields have set.
struct AppliedSettings {
  std::string where;               // begins errors about the file
  std::vector<std::string> names;  // of the fields, which are those of the options

  // A message about such an option names the file's field in its place.
  std::string with_source(const std::string& message) const;
  // Calls `use`, and puts the source before its UsageErrors.
  template <class Use>
  void naming(const Use& use) const {
    try {
      use();
    } catch (const UsageError& e) {
      throw UsageError(with_source(e.what()));
    }
  }
};

// Sets options from the fields of an object: those not given yet, in the order of the options. `where` begins errors.
// UsageError for a field that is no option, or a value that the option does not take.
AppliedSettings apply_settings(const std::vector<CLI::Option*>& options, const nlohmann::ordered_json& fields,
                               const std::string& where);
// The same from a file: an object of settings, or a SCENE.fit.json. If --scene or --object is given, the file's `scene`
// and `object` are not taken; if --quality is given, its `steps` and `size` are not.
AppliedSettings apply_settings_file(const std::vector<CLI::Option*>& options, const std::string& path);

// What --start says; a file with one of its words as a name is written ./NAME.
vsplat_fit_start start_of(const std::string& text);
// Whether the fit begins with what the network makes, or may do so.
bool uses_network(const FitSettings& settings);
// UsageError if the settings contradict each other.
void check(const FitSettings& settings);

// A scene to start from. Throws if it cannot be fitted.
vsplat::Scene start_scene(const std::string& path);
// The file of --start; "" if that is a word.
std::string start_file(const FitSettings& settings);

// What a job's options point to.
class FitInputs {
 public:
  // Sets the job's options.
  FitInputs(const FitSettings& settings, FitJob& job);
  FitInputs(const FitInputs&) = delete;
  FitInputs& operator=(const FitInputs&) = delete;

  // Reads the scene or the model to start from.
  void load();
  bool named() const { return !names_.empty(); }

 private:
  const FitSettings& settings_;
  FitJob& job_;
  vsplat_input_options input_ = VSPLAT_INPUT_OPTIONS_INIT;
  vsplat_reconstruct_options network_ = VSPLAT_RECONSTRUCT_OPTIONS_INIT;
  std::vector<std::string> names_;
  std::vector<const char*> name_pointers_;
  vsplat::Scene scene_;
  vsplat::Model model_;
};

}  // namespace command
