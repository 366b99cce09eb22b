// The nodes of a glTF file: where each stands, and which of them the scene shows.
#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

#include "model/io/reader/program/gltf_file.h"

namespace vsplat::read {

class GltfScene {
 public:
  // Wrong(format) where the nodes are no trees.
  explicit GltfScene(GltfFile& file);

  Field node(std::size_t i) const { return nodes_[i]; }
  // From the node's coordinates to the scene's.
  const Eigen::Matrix4d& place(std::size_t i) const { return places_[i]; }
  // Nodes with a mesh, in the scene's order.
  const std::vector<std::size_t>& shown() const { return shown_; }

 private:
  void find_parents();
  void find_places();
  std::vector<std::size_t> roots() const;
  void find_shown();

  GltfFile& file_;
  Field nodes_;
  std::vector<std::size_t> parents_;
  std::vector<Eigen::Matrix4d, Eigen::aligned_allocator<Eigen::Matrix4d>> places_;
  std::vector<std::size_t> shown_;
};

// Of a translation, a rotation (x, y, z, w) and a scale; of each that is empty, none.
Eigen::Matrix4d transform_of(const std::vector<double>& translation, const std::vector<double>& rotation,
                             const std::vector<double>& scale);

}  // namespace vsplat::read
