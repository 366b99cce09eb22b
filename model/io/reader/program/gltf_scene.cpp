#include "model/io/reader/program/gltf_scene.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>

namespace vsplat::read {
namespace {

constexpr std::size_t none = static_cast<std::size_t>(-1);

Eigen::Matrix4d local_place(const Field& node) {
  const std::vector<double> matrix = node["matrix"].numbers(16);
  if (!matrix.empty()) return Eigen::Map<const Eigen::Matrix4d>(matrix.data());  // glTF stores matrices by columns
  return transform_of(node["translation"].numbers(3), node["rotation"].numbers(4), node["scale"].numbers(3));
}

}  // namespace

Eigen::Matrix4d transform_of(const std::vector<double>& translation, const std::vector<double>& rotation,
                             const std::vector<double>& scale) {
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  if (!rotation.empty()) {
    Eigen::Quaterniond q(rotation[3], rotation[0], rotation[1], rotation[2]);
    if (q.norm() > 0) out.topLeftCorner<3, 3>() = q.normalized().toRotationMatrix();
  }
  for (int i = 0; i < 3; ++i) {
    if (!scale.empty()) out.col(i) *= scale[static_cast<std::size_t>(i)];
    if (!translation.empty()) out(i, 3) = translation[static_cast<std::size_t>(i)];
  }
  return out;
}

GltfScene::GltfScene(GltfFile& file) : file_(file), nodes_(file.list("nodes")) {
  find_parents();
  find_places();
  find_shown();
}

void GltfScene::find_parents() {
  parents_.assign(nodes_.size(), none);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Field children = nodes_[i]["children"];
    for (std::size_t k = 0; k < children.size(); ++k) {
      const std::size_t child = children[k].index(nodes_.size(), "nodes");
      if (parents_[child] != none)
        children[k].wrong(
            fmt::format("is {}, which is already a child of nodes[{}]: trees are expected", child, parents_[child]));
      parents_[child] = i;
    }
  }
}

// Computes each node's transform after its parent's. Nodes that are their own ancestors are never reached.
void GltfScene::find_places() {
  places_.assign(nodes_.size(), Eigen::Matrix4d::Identity());
  std::vector<std::size_t> left;
  for (std::size_t i = 0; i < nodes_.size(); ++i)
    if (parents_[i] == none) left.push_back(i);
  std::size_t reached = 0;
  for (; !left.empty(); ++reached) {
    const std::size_t i = left.back();
    left.pop_back();
    places_[i] = local_place(nodes_[i]);
    if (parents_[i] != none) places_[i] = places_[parents_[i]] * places_[i];
    const Field children = nodes_[i]["children"];
    for (std::size_t k = 0; k < children.size(); ++k) left.push_back(children[k].whole());
  }
  if (reached != nodes_.size()) nodes_.wrong("some nodes are their own ancestors: trees are expected");
}

// The root nodes of the scene; in a file without scenes, all nodes without a parent.
std::vector<std::size_t> GltfScene::roots() const {
  std::vector<std::size_t> out;
  const Field scenes = file_.list("scenes");
  if (scenes.size() == 0) {
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      if (parents_[i] == none) out.push_back(i);
    return out;
  }
  const Field chosen = file_.root()["scene"];
  const Field scene = chosen.there() ? chosen.in(scenes) : scenes[std::size_t{0}];
  for (std::size_t i = 0; i < scene["nodes"].size(); ++i)
    out.push_back(scene["nodes"][i].index(nodes_.size(), "nodes"));
  return out;
}

void GltfScene::find_shown() {
  std::vector<std::size_t> left = roots();
  std::vector<bool> seen(nodes_.size());
  std::reverse(left.begin(), left.end());
  while (!left.empty()) {
    const std::size_t i = left.back();
    left.pop_back();
    const Field node = nodes_[i];
    if (seen[i] || !node["extensions"]["KHR_node_visibility"]["visible"].flag(true)) continue;
    seen[i] = true;
    if (node["mesh"].there()) shown_.push_back(i);
    const Field children = node["children"];
    for (std::size_t k = children.size(); k-- > 0;) left.push_back(children[k].whole());
  }
}

}  // namespace vsplat::read
