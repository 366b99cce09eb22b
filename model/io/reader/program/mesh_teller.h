// Tells the library a mesh: pictures inside the file, then the materials, then part by part the triangles.
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
  // The next corner of the part, three a triangle; `vertex` is its number in the file, for errors. A normal of any
  // length becomes one of length 1. Wrong(input) where a number is not finite.
  void corner(MeshCorner corner, std::uint64_t vertex);
  void done();

 private:
  void say_corners();

  Library& library_;
  std::string part_;
  std::vector<MeshCorner> corners_;
};

}  // namespace vsplat::read
