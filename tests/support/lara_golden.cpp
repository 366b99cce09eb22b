#include "tests/support/lara_golden.h"

#include <Eigen/Dense>
#include <filesystem>

#include "model/io/archive/torch_file.h"
#include "model/networks/params/match_tensors.h"
#include "model/networks/params/params.h"
#include "tests/support/golden.h"

namespace vsplat::test {

template <class C>
std::string PublishedGolden<C>::checkpoint_of(const std::string& name) {
  const std::string vectors = Golden::path_of(name);
  return vectors.substr(0, vectors.rfind('.')) + ".ckpt";
}

template <class C>
bool PublishedGolden<C>::exists(const std::string& name) {
  return std::filesystem::exists(Golden::path_of(name));
}

template <class C>
PublishedGolden<C> PublishedGolden<C>::load(const std::string& name) {
  return {Golden::path_of(name), checkpoint_of(name)};
}

template <class C>
PublishedGolden<C>::PublishedGolden(const std::string& path, const std::string& checkpoint) : file_(path) {
  set_fields_from_json(config_, file_.metadata().at("config"));
  check(config_);
  const TorchFile weights(checkpoint);
  const std::vector<Parameter> expected = parameters(config_);
  weights_ = read_values(weights, expected, match_tensors(weights, expected, {"net."}));
  cameras_ = cameras_of("input");
  if (has("novel.c2w")) novel_ = cameras_of("novel");
}

template <class C>
std::vector<Camera> PublishedGolden<C>::cameras_of(const std::string& views) const {
  std::vector<Camera> out;
  const auto c2w = floats(views + ".c2w"), k = floats(views + ".K");
  for (std::size_t v = 0; v < c2w.size() / 16; ++v) {
    Camera camera;
    Eigen::Matrix4d m;
    for (int i = 0; i < 16; ++i) m(i / 4, i % 4) = static_cast<double>(c2w[v * 16 + static_cast<std::size_t>(i)]);
    camera.w2c = m.inverse();
    camera.width = camera.height = config_.image;
    camera.fx = k[v * 9], camera.cx = k[v * 9 + 2], camera.fy = k[v * 9 + 4], camera.cy = k[v * 9 + 5];
    out.push_back(camera);
  }
  return out;
}

template <class C>
HostTensor PublishedGolden<C>::tensor(const std::string& name) const {
  const TensorEntry& entry = file_.at(name);
  return {entry.shape, file_.floats(entry)};
}

template <class C>
std::vector<int> PublishedGolden<C>::integers(const std::string& name) const {
  const std::vector<std::int64_t> values = file_.integers(file_.at(name));
  return {values.begin(), values.end()};
}

template class PublishedGolden<LaraConfig>;
template class PublishedGolden<GendenConfig>;
template class PublishedGolden<VsplatGendenConfig>;

const std::vector<std::string>& lara_cases() {
  static const std::vector<std::string> names = {"lara_tiny", "lara_tiny_gaussian", "lara_micro_gaussian"};
  return names;
}

const std::vector<std::string>& genden_cases() {
  static const std::vector<std::string> names = {"genden_tiny", "genden_tiny_residual"};
  return names;
}

const std::vector<std::string>& slow_lara_cases() {
  static const std::vector<std::string> names = {"lara_tiny_seed1", "lara_tiny_seed2"};
  return names;
}

const std::vector<std::string>& slow_genden_cases() {
  static const std::vector<std::string> names = {"genden_tiny_seed1", "genden_tiny_seed2", "genden_tiny_residual_seed1",
                                                 "genden_tiny_residual_seed2"};
  return names;
}

}  // namespace vsplat::test
