// An object of a data set as a folder: pictures from all around, and transforms.json, as any reader of views takes it.
#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "model/data/mesh.h"

namespace vsplat {

struct ObjectOptions {
  int views = 40, size = 512;      // pictures, and their sides in pixels
  std::uint64_t seed = 0;          // of the cameras,
  std::uint32_t object = 0;        // which differ from object to object of a set
  std::function<bool(double)> go;  // told the share that is done; false: Error(cancelled)
};

// images/0000.png, ... and transforms.json, in `folder`.
std::vector<std::string> object_files(const std::string& folder, int views);

// Fits the mesh into the cube, draws it from sphere_cameras(), writes RGBA pictures of 8 bits and transforms.json with
// the cube. The folder appears whole or not at all (runtime/files/staged_folder.h): of an earlier object all pictures go with
// it, what else lies there stays. Error(file) where another process is writing that object.
void write_object(const std::string& folder, Mesh mesh, const ObjectOptions& options);

}  // namespace vsplat
