// Vectors of LaRa's specification: a file of tests/reference/pytorch/make_published.py --tests, with the weights in a
// checkpoint beside it.
#pragma once
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/params/lara_config.h"
#include "model/params/weights.h"
#include "runtime/safetensors.h"

namespace vsplat::test {

class LaraGolden {
 public:
  // "lara_micro" is committed; golden_tiny makes lara_cases().
  static LaraGolden load(const std::string& name);
  static bool exists(const std::string& name);
  // The checkpoint.
  static std::string checkpoint_of(const std::string& name);

  const LaraConfig& config() const { return config_; }
  const Weights& weights() const { return weights_; }
  const std::vector<Camera>& cameras() const { return cameras_; }

  bool has(const std::string& name) const { return file_.find(name) != nullptr; }
  HostTensor tensor(const std::string& name) const;
  std::vector<float> floats(const std::string& name) const { return tensor(name).data; }
  std::vector<int> kept() const;  // stage.fine.index
  const SafetensorsFile& file() const { return file_; }

 private:
  LaraGolden(const std::string& path, const std::string& checkpoint);

  SafetensorsFile file_;
  LaraConfig config_;
  Weights weights_;
  std::vector<Camera> cameras_;
};

// Those that golden_tiny makes where PyTorch is there.
const std::vector<std::string>& lara_cases();

}  // namespace vsplat::test

// In a test's body: skips it, visibly, where the file has not been made.
#define VSPLAT_NEED_LARA_GOLDEN(name)            \
  if (!::vsplat::test::LaraGolden::exists(name)) \
  GTEST_SKIP() << (name) << " is not there (ctest's golden_tiny makes it, with PyTorch)"
