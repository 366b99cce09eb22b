// What the tests of whole networks share: stages and pictures against the specification's vectors.
#pragma once
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "model/base/gaussians.h"
#include "model/networks/layers/forward_options.h"
#include "model/ops/networks/view_maps.h"
#include "runtime/context.h"
#include "runtime/fail.h"
#include "runtime/files/safetensors.h"
#include "tests/support/device.h"

namespace vsplat::test {

// Uploads a tensor of the file unchanged.
template <class Vectors>
Tensor upload(Context& ctx, const Vectors& golden, const std::string& name) {
  const HostTensor t = golden.tensor(name);
  return ctx.upload(t.shape, t.data, Type::f32, name);
}

template <class Vectors>
ViewDrawings drawings(Context& ctx, const Vectors& golden) {
  return {upload(ctx, golden, "stage.drawing.image"), upload(ctx, golden, "stage.drawing.alpha"),
          upload(ctx, golden, "stage.drawing.depth")};
}

// The cotangents of level "coarse" or "final".
template <class Vectors>
GaussianGradients cotangents(Context& ctx, const Vectors& golden, const std::string& level) {
  const auto field = [&](const char* name) { return upload(ctx, golden, "cotangent." + level + "." + name); };
  return {field("means"), field("scales"), field("quats"), field("opacities"), field("sh")};
}

// The outputs of a network's stages.
struct StageOutputs {
  std::map<std::string, std::vector<float>> values;
  // Channels of a row: SH [N,S,3] are S colours, each coefficient with its own scale; a single number is its own row.
  std::map<std::string, std::size_t> channels;

  std::function<void(const std::string&, const Tensor&)> tap(Context& ctx) {
    return [this, &ctx](const std::string& name, const Tensor& t) {
      values[name] = ctx.read<float>(t);
      const Shape& shape = t.shape();
      channels[name] =
          shape.size() < 2
              ? 1
              : static_cast<std::size_t>(shape.size() == 3 && shape[2] == 3 ? shape[1] * shape[2] : shape.back());
    };
  }
};

// 99.9 % of the values within 2e-3 of the largest (at least 1), the mean within 1e-5.
inline void expect_picture(const std::vector<float>& got, const std::vector<float>& want, const std::string& what) {
  ASSERT_EQ(got.size(), want.size()) << what;
  double largest = 1, sum = 0;
  for (const float v : want) largest = std::max(largest, std::abs(static_cast<double>(v)));
  std::size_t off = 0;
  for (std::size_t i = 0; i < got.size(); ++i) {
    const double error = std::abs(static_cast<double>(got[i]) - want[i]) / largest;
    ASSERT_TRUE(std::isfinite(error)) << what << " at " << i;
    sum += error;
    off += error > 2e-3;
  }
  EXPECT_LE(static_cast<double>(off), 1e-3 * static_cast<double>(got.size())) << what;
  EXPECT_LE(sum / static_cast<double>(got.size()), 1e-5) << what;
}

// Expects run(context) to be refused for lack of memory in 60 % of the plan's.
inline void expect_refused_when_tight(Flavour flavour, const MemoryPlan& plan,
                                      const std::function<void(Context&)>& run) {
  ContextOptions tight;
  tight.max_memory_gib = 0.6 * static_cast<double>(plan.peak) / (1ull << 30);
  const auto small = open_context(flavour, tight);
  try {
    run(*small);
    FAIL() << "ran in 60 % of the memory that it needs";
  } catch (const Error& e) {
    EXPECT_EQ(e.status(), Status::memory) << e.what();
    EXPECT_NE(std::string(e.what()).find("GiB"), std::string::npos) << e.what();
  }
}

// All names of some lists.
inline std::vector<std::string> joined(std::vector<std::string> first, const std::vector<std::string>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

}  // namespace vsplat::test
