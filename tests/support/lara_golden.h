// Vectors of LaRa's and GenDen's specifications: a file of tests/reference/pytorch/make_published.py --tests, with the
// weights in a checkpoint beside it.
#pragma once
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/params/genden_config.h"
#include "model/params/lara_config.h"
#include "model/params/vsplat_genden_config.h"
#include "model/params/weights.h"
#include "runtime/safetensors.h"

namespace vsplat::test {

template <class Configuration>
class PublishedGolden {
 public:
  // "lara_micro" and "genden_micro" are committed; golden_tiny makes lara_cases() and genden_cases().
  static PublishedGolden load(const std::string& name);
  static bool exists(const std::string& name);
  // The checkpoint.
  static std::string checkpoint_of(const std::string& name);

  const Configuration& config() const { return config_; }
  const Weights& weights() const { return weights_; }
  const std::vector<Camera>& cameras() const { return cameras_; }  // of the input views
  const std::vector<Camera>& novel() const { return novel_; }      // of the views beside them

  bool has(const std::string& name) const { return file_.find(name) != nullptr; }
  HostTensor tensor(const std::string& name) const;
  std::vector<float> floats(const std::string& name) const { return tensor(name).data; }
  std::vector<int> integers(const std::string& name) const;
  std::vector<int> kept() const { return integers("stage.fine.index"); }
  const SafetensorsFile& file() const { return file_; }

 private:
  std::vector<Camera> cameras_of(const std::string& views) const;
  PublishedGolden(const std::string& path, const std::string& checkpoint);

  SafetensorsFile file_;
  Configuration config_;
  Weights weights_;
  std::vector<Camera> cameras_, novel_;
};

using LaraGolden = PublishedGolden<LaraConfig>;
using GendenGolden = PublishedGolden<GendenConfig>;
using VsplatGendenGolden = PublishedGolden<VsplatGendenConfig>;

// Those that golden_tiny makes where PyTorch is there.
const std::vector<std::string>& lara_cases();
const std::vector<std::string>& genden_cases();

}  // namespace vsplat::test

// In a test's body: skips it, visibly, where the file has not been made.
#define VSPLAT_NEED_LARA_GOLDEN(name)            \
  if (!::vsplat::test::LaraGolden::exists(name)) \
  GTEST_SKIP() << (name) << " is not there (ctest's golden_tiny makes it, with PyTorch)"
