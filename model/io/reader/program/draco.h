// Primitives that KHR_draco_mesh_compression packs.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "model/io/reader/program/gltf_accessor.h"

namespace vsplat::read {

class DracoMesh {
 public:
  // Unpacks what a primitive's extension names. Wrong where it is damaged.
  DracoMesh(GltfFile& file, const Field& extension);
  ~DracoMesh();
  DracoMesh(const DracoMesh&) = delete;
  DracoMesh& operator=(const DracoMesh&) = delete;

  bool has(const std::string& attribute) const;
  // An attribute's numbers as `accessor` says that they are meant.
  Numbers numbers(const std::string& attribute, const Field& accessor, const std::vector<std::size_t>& widths) const;
  std::vector<std::uint32_t> indices() const;  // three a triangle

 private:
  struct Mesh;
  Field extension_;
  std::unique_ptr<Mesh> mesh_;
};

}  // namespace vsplat::read
