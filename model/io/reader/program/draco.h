// Decodes primitives compressed with KHR_draco_mesh_compression.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "model/io/reader/program/gltf_accessor.h"

namespace vsplat::read {

class DracoMesh {
 public:
  // Decompresses the data that a primitive's extension names. Throws Wrong if they are damaged.
  DracoMesh(GltfFile& file, const Field& extension);
  ~DracoMesh();
  DracoMesh(const DracoMesh&) = delete;
  DracoMesh& operator=(const DracoMesh&) = delete;

  bool has(const std::string& attribute) const;
  // An attribute's values, scaled as `accessor` specifies.
  Numbers numbers(const std::string& attribute, const Field& accessor, const std::vector<std::size_t>& widths) const;
  std::vector<std::uint32_t> indices() const;  // three per triangle

 private:
  struct Mesh;
  Field extension_;
  std::unique_ptr<Mesh> mesh_;
};

}  // namespace vsplat::read
