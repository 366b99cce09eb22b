// Vectors of the PyTorch specification: a file of tests/reference/pytorch/make_golden.py, which documents the names.
#pragma once
#include <string>
#include <vector>

#include "model/networks/params/config.h"
#include "model/networks/params/model_file.h"
#include "model/networks/params/weights.h"
#include "runtime/files/safetensors.h"

namespace vsplat::test {

class Golden {
 public:
  // `name` of a committed file ("micro", "micro_noise": tests/golden/) or of a file made by the fixture
  // (golden_cases()), or any path that ends in .safetensors.
  static Golden load(const std::string& name) { return Golden(path_of(name)); }
  static std::string path_of(const std::string& name);
  static bool exists(const std::string& name);

  const Config& config() const { return config_; }
  int views() const { return views_; }  // of the network's input; `input.*` has two more, for rendering
  double temperature() const { return temperature_; }
  const Weights& weights() const { return weights_; }

  bool has(const std::string& name) const { return file_.find(name) != nullptr; }
  HostTensor tensor(const std::string& name) const;
  std::vector<float> floats(const std::string& name) const { return tensor(name).data; }
  std::vector<std::int64_t> integers(const std::string& name) const { return file_.integers(file_.at(name)); }
  const SafetensorsFile& file() const { return file_; }

 private:
  explicit Golden(const std::string& path);

  SafetensorsFile file_;
  Config config_;
  Weights weights_;
  int views_ = 0;
  double temperature_ = 0;
};

// The cases that the ctest fixture makes if PyTorch is installed: tiny with two seeds, 1 and 6 views, noise and every
// variant, and micro cases, which have gradients.
const std::vector<std::string>& golden_cases();

// The cases of make_extensions.py with the whole model: DINOv3's encoder, and predicted rays with noisy poses.
// golden_tiny makes them; all have gradients.
const std::vector<std::string>& extension_cases();
// Two more seeds of them, made by golden_tiny_slow.
const std::vector<std::string>& slow_extension_cases();

// The cases with all gradients, made by golden_train, and those made by golden_train_slow.
const std::vector<std::string>& quick_training_cases();
const std::vector<std::string>& slow_training_cases();

}  // namespace vsplat::test

// In a test's body: skips the test, visibly, if the file has not been made.
#define VSPLAT_NEED_GOLDEN(name)             \
  if (!::vsplat::test::Golden::exists(name)) \
  GTEST_SKIP() << ::vsplat::test::Golden::path_of(name) << " is not there (ctest's golden_tiny makes it, with PyTorch)"
