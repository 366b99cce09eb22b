// Vectors of LaRa's and GenDen's specifications: a file of tests/reference/pytorch/make_published.py, with the
// weights in a checkpoint beside it.
#pragma once
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/networks/params/genden_config.h"
#include "model/networks/params/lara_config.h"
#include "model/networks/params/vsplat_genden_config.h"
#include "model/networks/params/weights.h"
#include "runtime/files/safetensors.h"
#include "tests/support/compare.h"

namespace vsplat::test {

template <class Configuration>
class PublishedGolden {
 public:
  // "lara_micro" and "genden_micro" are committed; golden_tiny makes lara_cases() and genden_cases().
  static PublishedGolden load(const std::string& name);
  static bool exists(const std::string& name);
  // Path of the checkpoint.
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

// The cases that golden_tiny makes if PyTorch is installed.
const std::vector<std::string>& lara_cases();
const std::vector<std::string>& genden_cases();
// Two more seeds, made by golden_tiny_slow.
const std::vector<std::string>& slow_lara_cases();
const std::vector<std::string>& slow_genden_cases();

// Expects the gradient of every weight to equal the vector `prefix` + its name, or zeros if there is none. Returns the
// number of vectors. `rounding`: gradients of weights whose names end like this are 0 up to rounding.
template <class Golden>
int expect_gradients(const Golden& golden, const std::string& prefix,
                     const std::map<std::string, std::vector<float>>& gradients, const std::string& rounding = "") {
  int compared = 0;
  for (const auto& [weight, got] : gradients) {
    if (!golden.has(prefix + weight)) {
      EXPECT_EQ(got, std::vector<float>(got.size(), 0.0f)) << prefix << weight << " has none";
      continue;
    }
    ++compared;
    if (!rounding.empty() && weight.ends_with(rounding))
      for (const float g : got) EXPECT_LE(std::abs(g), 1e-6) << weight;
    else
      EXPECT_TRUE(close(got, golden.floats(prefix + weight), 1e-4)) << prefix << weight;
  }
  return compared;
}

}  // namespace vsplat::test

// In a test's body: skips the test, visibly, if the file has not been made.
#define VSPLAT_NEED_LARA_GOLDEN(name)            \
  if (!::vsplat::test::LaraGolden::exists(name)) \
  GTEST_SKIP() << (name) << " is not there (ctest's golden_tiny makes it, with PyTorch)"
