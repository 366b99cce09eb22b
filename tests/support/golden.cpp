#include "tests/support/golden.h"

#include <filesystem>

#include "runtime/error.h"

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

namespace {

std::vector<std::string> variants(const std::string& prefix) {
  std::vector<std::string> out;
  for (const char* name :
       {"coarse", "skeletal", "sigmoid", "ste", "opacity", "unprojected", "fine1", "fine4", "mirrored", "distance",
        "kernel3", "no_half_pixel", "empty", "empty_sigmoid", "empty_ste", "empty_opacity"})
    out.push_back(prefix + name);
  return out;
}

}  // namespace

const std::vector<std::string>& training_cases() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> out = variants("train_micro_");
    for (const char* name : {"train_tiny", "train_tiny_seed1", "train_tiny_steps"}) out.emplace_back(name);
    return out;
  }();
  return names;
}

const std::vector<std::string>& larger_training_cases() {
  static const std::vector<std::string> names = variants("train_tiny_");
  return names;
}

}  // namespace vsplat::test
