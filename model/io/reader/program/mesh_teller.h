// Sends a mesh to the library: embedded pictures, then materials, then the triangles of each part.
#pragma once
#include <span>
#include <vector>

#include "model/io/reader/mesh_messages.h"
#include "model/io/reader/program/library.h"

namespace vsplat::read {

class MeshTeller {
 public:
  explicit MeshTeller(Library& library) : library_(library) {}

  void texture(const std::string& name, std::span<const unsigned char> encoded);
  void materials(const std::vector<MeshMaterial>& all);
  void part(const MeshPart& part);
  // Sends the next corner of the part, three per triangle; `vertex` is its index in the file, for errors. Normals are
  // normalised to length 1. Throws Wrong(input) if a number is not finite.
  void corner(MeshCorner corner, std::uint64_t vertex);
  void done();

 private:
  void say_corners();

  Library& library_;
  std::string part_;
  std::vector<MeshCorner> corners_;
};

}  // namespace vsplat::read
