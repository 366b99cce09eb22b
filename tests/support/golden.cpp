#include "tests/support/golden.h"

#include <filesystem>

#include "runtime/fail.h"
#include "tests/support/golden_file.h"

namespace vsplat::test {
namespace {

const std::string& metadata_at(const SafetensorsFile& file, const std::string& key) {
  const auto it = file.metadata().find(key);
  if (it == file.metadata().end()) fail(Status::format, "{}: not golden vectors: no {}", file.path(), key);
  return it->second;
}

}  // namespace

std::string Golden::path_of(const std::string& name) {
  if (name.ends_with(".safetensors")) return name;
  const std::string committed = std::string(VSPLAT_SOURCE_DIR) + "/tests/golden/" + name + ".safetensors";
  if (std::filesystem::exists(committed)) return committed;
  return std::string(VSPLAT_GOLDEN_DIR) + "/" + name + ".safetensors";
}

std::string golden_file(const std::string& name) { return std::string(VSPLAT_SOURCE_DIR) + "/tests/golden/" + name; }

bool Golden::exists(const std::string& name) { return std::filesystem::exists(path_of(name)); }

Golden::Golden(const std::string& path)
    : file_(path),
      config_(config_from_json(metadata_at(file_, "config"))),
      weights_(read_weights(file_, config_, "weight.")),
      views_(std::stoi(metadata_at(file_, "views"))),
      temperature_(std::stod(metadata_at(file_, "temperature"))) {}

HostTensor Golden::tensor(const std::string& name) const {
  const TensorEntry& entry = file_.at(name);
  return {entry.shape, file_.floats(entry)};
}

const std::vector<std::string>& golden_cases() {
  static const std::vector<std::string> names = {"tiny",
                                                 "tiny_seed1",
                                                 "tiny_views1",
                                                 "tiny_views6",
                                                 "tiny_noise",
                                                 "tiny_noise_seed1",
                                                 "tiny_coarse",
                                                 "tiny_skeletal",
                                                 "tiny_sigmoid",
                                                 "tiny_ste",
                                                 "tiny_opacity",
                                                 "tiny_unprojected",
                                                 "tiny_fine1",
                                                 "tiny_mirrored",
                                                 "tiny_paper",
                                                 "tiny_empty",
                                                 "micro_levels1",
                                                 "micro_levels3",
                                                 "micro_wide",
                                                 "micro_coarse",
                                                 "micro_skeletal",
                                                 "micro_skeletal_sigmoid",
                                                 "micro_skeletal_ste",
                                                 "micro_skeletal_opacity"};
  return names;
}

const std::vector<std::string>& extension_cases() {
  static const std::vector<std::string> names = {"dinov3_micro_model", "dinov3_tiny_model", "share_micro_model",
                                                 "share_tiny_model"};
  return names;
}

const std::vector<std::string>& slow_extension_cases() {
  static const std::vector<std::string> names = {"dinov3_tiny_seed1_model", "dinov3_tiny_seed2_model",
                                                 "share_tiny_seed1_model", "share_tiny_seed2_model"};
  return names;
}

const std::vector<std::string>& quick_training_cases() {
  static const std::vector<std::string> names = {"train", "train_steps", "train_ste", "train_mirrored",
                                                 "train_empty_ste"};
  return names;
}

const std::vector<std::string>& slow_training_cases() {
  static const std::vector<std::string> names = {
      "train_coarse", "train_skeletal",      "train_sigmoid",      "train_opacity", "train_unprojected",
      "train_fine1",  "train_fine4",         "train_distance",     "train_kernel3", "train_no_half_pixel",
      "train_empty",  "train_empty_sigmoid", "train_empty_opacity"};
  return names;
}

}  // namespace vsplat::test
