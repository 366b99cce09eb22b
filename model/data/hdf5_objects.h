// Objects in LaRa's HDF5 layout (GObjaverse and CO3D as LaRa prepares them): a group per object with image_I [H,W,4]
// (unsigned 8 bits, straight alpha), c2w_I [4,4] (camera-to-world, OpenCV axes) and fov_I [2] (radians, along x and y),
// I = 0, 1, ...; the principal point is the picture's middle.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/views/input.h"

namespace vsplat {

bool is_hdf5_name(const std::string& path);  // .h5 or .hdf5

struct Hdf5Object {
  std::string file, group;
};

// Of each of the files, by the groups' names; `splits` and what is linked from another of the files are left out.
std::vector<Hdf5Object> hdf5_objects(const std::vector<std::string>& files);

// Every view, looked at but not decoded. What is wrong with one is given to `bad` with its index and name, which throws
// or has the view left out.
Photographs open_hdf5_object(const Hdf5Object& object,
                             const std::function<void(int view, const std::string& name, const Error& error)>& bad);

}  // namespace vsplat
