// Objects in LaRa's HDF5 layout (GObjaverse and CO3D as prepared by LaRa): a group per object with image_I [H,W,4]
// (8-bit unsigned, straight alpha), c2w_I [4,4] (camera-to-world, OpenCV axes) and fov_I [2] (radians, along x and y)
// for I = 0, 1, ...; the principal point is the picture's centre.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/views/input.h"

namespace vsplat {

bool is_hdf5_name(const std::string& path);  // ends in .h5 or .hdf5

struct Hdf5Object {
  std::string file, group;
};

// The objects in all files, sorted by group name, without `splits` and without links to another of the files.
std::vector<Hdf5Object> hdf5_objects(const std::vector<std::string>& files);

// All views, checked but not decoded. Calls `bad` with the index, name and error of a bad view; `bad` either throws, or
// the view is omitted.
Photographs open_hdf5_object(const Hdf5Object& object,
                             const std::function<void(int view, const std::string& name, const Error& error)>& bad);

}  // namespace vsplat
