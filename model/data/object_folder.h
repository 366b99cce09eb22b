// Writes an object of a data set as a folder: pictures from all around and transforms.json, readable by any reader of
// views.
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
  std::uint32_t object = 0;        // which differ between the objects of a set
  std::function<bool(double)> go;  // gets the completed share; returning false causes Error(cancelled)
};

// images/0000.png, ... and transforms.json, in `folder`.
std::vector<std::string> object_files(const std::string& folder, int views);

// Fits the mesh into the cube, renders it from sphere_cameras(), and writes 8-bit RGBA pictures and transforms.json
// with the cube. The folder appears completely or not at all (runtime/files/staged_folder.h). It replaces all pictures
// of an earlier object; other files stay. Error(file) if another process is writing the same object.
void write_object(const std::string& folder, Mesh mesh, const ObjectOptions& options);

}  // namespace vsplat
