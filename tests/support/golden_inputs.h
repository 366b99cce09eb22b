// The inputs of a stage, from golden vectors.
#pragma once
#include <Eigen/Dense>
#include <vector>

#include "model/base/device_cameras.h"
#include "model/base/gaussians.h"
#include "runtime/context.h"
#include "tests/support/golden.h"

namespace vsplat::test {

// All cameras: the network's input views, then the views that are only drawn.
inline std::vector<Camera> golden_all_cameras(const Golden& golden, const std::string& poses = "input.c2w") {
  const auto c2w = golden.floats(poses), k = golden.floats("input.K");
  std::vector<Camera> cameras;
  for (std::size_t v = 0; v < c2w.size() / 16; ++v) {
    Camera camera;
    Eigen::Matrix4d m;
    for (int i = 0; i < 16; ++i) m(i / 4, i % 4) = static_cast<double>(c2w[v * 16 + static_cast<std::size_t>(i)]);
    camera.w2c = m.inverse();
    camera.width = camera.height = golden.config().image;
    camera.fx = k[v * 9], camera.cx = k[v * 9 + 2], camera.fy = k[v * 9 + 4], camera.cy = k[v * 9 + 5];
    cameras.push_back(camera);
  }
  return cameras;
}

// The network's input views with the poses that it receives, including their noise.
inline std::vector<Camera> golden_cameras(const Golden& golden) {
  const bool noisy = golden.has("input.c2w_given");
  std::vector<Camera> cameras = golden_all_cameras(golden, noisy ? "input.c2w_given" : "input.c2w");
  cameras.resize(static_cast<std::size_t>(golden.views()));
  return cameras;
}

// volume_network.conv_in[0] of the golden mean and variance, [R^3, 4 C~].
inline std::vector<float> golden_compressed(const Golden& golden) {
  const std::vector<float> lifted = golden.floats("stage.lifted");  // [1, 2C, R, R, R]
  const std::vector<float>& weight = golden.weights().at("volume_network.conv_in.0.weight").data;
  const std::vector<float>& bias = golden.weights().at("volume_network.conv_in.0.bias").data;
  const auto voxels = static_cast<std::size_t>(golden.config().voxels());
  const std::size_t k = lifted.size() / voxels, n = bias.size();
  std::vector<float> out(voxels * n);
  for (std::size_t p = 0; p < voxels; ++p) {
    for (std::size_t j = 0; j < n; ++j) {
      double sum = bias[j];
      for (std::size_t i = 0; i < k; ++i) sum += static_cast<double>(weight[j * k + i]) * lifted[i * voxels + p];
      out[p * n + j] = static_cast<float>(sum);
    }
  }
  return out;
}

// The selected voxels, (i R + j) R + k, from "stage.coords" [P, 3].
inline std::vector<int> golden_index(const Golden& golden) {
  const int r = golden.config().volume;
  const std::vector<std::int64_t> coords = golden.integers("stage.coords");
  std::vector<int> index;
  for (std::size_t i = 0; i < coords.size(); i += 3) {
    index.push_back((static_cast<int>(coords[i]) * r + static_cast<int>(coords[i + 1])) * r +
                    static_cast<int>(coords[i + 2]));
  }
  return index;
}

// Uploads a tensor of the file unchanged.
inline Tensor golden_upload(Context& ctx, const Golden& golden, const std::string& name) {
  const HostTensor t = golden.tensor(name);
  return ctx.upload(t.shape, t.data, Type::f32, name);
}

// "stage.coarse" or "stage.final".
inline DeviceGaussians golden_gaussians(Context& ctx, const Golden& golden, const std::string& name) {
  return {golden_upload(ctx, golden, name + ".means"), golden_upload(ctx, golden, name + ".scales"),
          golden_upload(ctx, golden, name + ".quats"), golden_upload(ctx, golden, name + ".opacities"),
          golden_upload(ctx, golden, name + ".sh")};
}

// The cases of golden_cases() that exist, and the committed ones.
inline std::vector<std::string> golden_present() {
  std::vector<std::string> names = {"micro", "micro_noise"};
  for (const std::string& name : golden_cases()) {
    if (Golden::exists(name)) names.push_back(name);
  }
  return names;
}

}  // namespace vsplat::test
