// The nodes of a glTF file: their transforms, and which of them the scene shows.
#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

#include "model/io/reader/program/gltf_file.h"

namespace vsplat::read {

class GltfScene {
 public:
  // Throws Wrong(format) if the nodes do not form trees.
  explicit GltfScene(GltfFile& file);

  Field node(std::size_t i) const { return nodes_[i]; }
  // Transform from the node's coordinates to the scene's.
  const Eigen::Matrix4d& place(std::size_t i) const { return places_[i]; }
  // Visible nodes with a mesh, in scene order.
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

// Matrix of a translation, a rotation (x, y, z, w) and a scale; an empty one is the identity.
Eigen::Matrix4d transform_of(const std::vector<double>& translation, const std::vector<double>& rotation,
                             const std::vector<double>& scale);

}  // namespace vsplat::read
