// A primitive of a glTF mesh: its vertices, morphed, and the triangles between them.
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
  // `weights` are those of its morph targets.
  GltfPrimitive(GltfFile& file, const Field& primitive, const std::vector<double>& weights);

  const Field& field() const { return primitive_; }
  std::size_t count() const { return positions_.count; }  // of vertices
  const Numbers& positions() const { return positions_; }
  // None where it has no such attribute. Wrong where it has not one for each vertex.
  std::optional<Numbers> attribute(const std::string& name, const std::vector<std::size_t>& widths);
  std::vector<std::uint32_t> wholes(const std::string& name);  // four a vertex
  bool has(const std::string& name) const { return primitive_["attributes"][name.c_str()].there(); }

  // Three vertices each; of points and lines, none.
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

// Whether it is made of triangles.
bool has_triangles(const Field& primitive);

}  // namespace vsplat::read
