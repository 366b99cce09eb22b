// A primitive of a glTF mesh: its morphed vertices and its triangles.
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "model/io/reader/program/draco.h"
#include "model/io/reader/program/gltf_accessor.h"

namespace vsplat::read {

class GltfPrimitive {
 public:
  // `weights` of the morph targets.
  GltfPrimitive(GltfFile& file, const Field& primitive, const std::vector<double>& weights);

  const Field& field() const { return primitive_; }
  std::size_t count() const { return positions_.count; }  // number of vertices
  const Numbers& positions() const { return positions_; }
  // Nothing if the attribute is absent. Throws Wrong unless it has one element for each vertex.
  std::optional<Numbers> attribute(const std::string& name, const std::vector<std::size_t>& widths);
  std::vector<std::uint32_t> wholes(const std::string& name);  // four per vertex
  bool has(const std::string& name) const { return primitive_["attributes"][name.c_str()].there(); }

  // Three vertices per triangle; empty for points and lines.
  std::vector<std::uint32_t> triangles();

 private:
  void morph(const std::string& name, Numbers& numbers);
  std::vector<std::uint32_t> indices();

  GltfFile& file_;
  Field primitive_;
  std::vector<double> weights_;
  std::unique_ptr<DracoMesh> draco_;
  Numbers positions_;
};

// Whether the primitive consists of triangles.
bool has_triangles(const Field& primitive);

}  // namespace vsplat::read
