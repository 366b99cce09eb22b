#include "tests/support/lara_golden.h"

#include <Eigen/Dense>
#include <filesystem>

#include "model/io/torch_file.h"
#include "model/params/match_tensors.h"
#include "model/params/params.h"
#include "tests/support/golden.h"

namespace vsplat::test {

std::string LaraGolden::checkpoint_of(const std::string& name) {
  const std::string vectors = Golden::path_of(name);
  return vectors.substr(0, vectors.rfind('.')) + ".ckpt";
}

bool LaraGolden::exists(const std::string& name) { return std::filesystem::exists(Golden::path_of(name)); }

LaraGolden LaraGolden::load(const std::string& name) { return {Golden::path_of(name), checkpoint_of(name)}; }

LaraGolden::LaraGolden(const std::string& path, const std::string& checkpoint)
    : file_(path), config_(lara_config_from_json(file_.metadata().at("config"))) {
  const TorchFile weights(checkpoint);
  const std::vector<Parameter> expected = parameters(config_);
  weights_ = read_values(weights, expected, match_tensors(weights, expected, {"net."}));
  const auto c2w = floats("input.c2w"), k = floats("input.K");
  for (std::size_t v = 0; v < c2w.size() / 16; ++v) {
    Camera camera;
    Eigen::Matrix4d m;
    for (int i = 0; i < 16; ++i) m(i / 4, i % 4) = static_cast<double>(c2w[v * 16 + static_cast<std::size_t>(i)]);
    camera.w2c = m.inverse();
    camera.width = camera.height = config_.image;
    camera.fx = k[v * 9], camera.cx = k[v * 9 + 2], camera.fy = k[v * 9 + 4], camera.cy = k[v * 9 + 5];
    cameras_.push_back(camera);
  }
}

HostTensor LaraGolden::tensor(const std::string& name) const {
  const TensorEntry& entry = file_.at(name);
  return {entry.shape, file_.floats(entry)};
}

std::vector<int> LaraGolden::kept() const {
  const std::vector<std::int64_t> index = file_.integers(file_.at("stage.fine.index"));
  return {index.begin(), index.end()};
}

const std::vector<std::string>& lara_cases() {
  static const std::vector<std::string> names = {"lara_tiny", "lara_tiny_gaussian", "lara_micro_gaussian"};
  return names;
}

}  // namespace vsplat::test
