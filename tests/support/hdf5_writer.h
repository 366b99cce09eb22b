// Writes HDF5 files in LaRa's layout for tests, with the HDF5 library.
#pragma once
#include <hdf5.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/base/image.h"

namespace vsplat::test {

class Hdf5Writer {
 public:
  explicit Hdf5Writer(const std::string& path)
      : file_(good(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT))) {}
  ~Hdf5Writer() { H5Fclose(file_); }
  Hdf5Writer(const Hdf5Writer&) = delete;
  Hdf5Writer& operator=(const Hdf5Writer&) = delete;

  // Writes an array of the memory type, in the file as the stored type; on request in one chunk with gzip. Creates
  // missing groups.
  template <class T>
  void write(const std::string& name, const std::vector<hsize_t>& shape, const std::vector<T>& values, hid_t memory,
             hid_t stored, bool gzip = false) {
    const hid_t links = good(H5Pcreate(H5P_LINK_CREATE)), creation = good(H5Pcreate(H5P_DATASET_CREATE));
    H5Pset_create_intermediate_group(links, 1);
    if (gzip) {
      H5Pset_chunk(creation, static_cast<int>(shape.size()), shape.data());
      H5Pset_deflate(creation, 4);
    }
    const hid_t space = good(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr));
    const hid_t data = good(H5Dcreate2(file_, name.c_str(), stored, space, links, creation, H5P_DEFAULT));
    good(H5Dwrite(data, memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()));
    H5Dclose(data), H5Sclose(space), H5Pclose(creation), H5Pclose(links);
  }

  void picture(const std::string& name, const Image& image) {  // of 8-bit values
    std::vector<unsigned char> bytes;
    bytes.reserve(image.data.size());
    for (const float v : image.data) bytes.push_back(static_cast<unsigned char>(std::lround(255 * v)));
    write(name,
          {static_cast<hsize_t>(image.height), static_cast<hsize_t>(image.width), static_cast<hsize_t>(image.channels)},
          bytes, H5T_NATIVE_UINT8, H5T_STD_U8LE, true);
  }
  void numbers(const std::string& name, const std::vector<hsize_t>& shape, const std::vector<double>& values,
               bool single = true) {
    write(name, shape, values, H5T_NATIVE_DOUBLE, single ? H5T_IEEE_F32LE : H5T_IEEE_F64LE);
  }
  void pose(const std::string& name, const Camera& camera, bool single = true) {
    const Eigen::Matrix4d c2w = camera.c2w();
    std::vector<double> values;
    values.reserve(16);
    for (int i = 0; i < 16; ++i) values.push_back(c2w(i / 4, i % 4));
    numbers(name, {4, 4}, values, single);
  }
  // image_I, c2w_I and fov_I of a group.
  void view(const std::string& group, int index, const Image& image, const Camera& camera, bool single = true) {
    const std::string i = std::to_string(index);
    picture(group + "/image_" + i, image);
    pose(group + "/c2w_" + i, camera, single);
    numbers(group + "/fov_" + i, {2},
            {2 * std::atan(0.5 * camera.width / camera.fx), 2 * std::atan(0.5 * camera.height / camera.fy)}, single);
  }
  void external(const std::string& name, const std::string& file, const std::string& target) {
    good(H5Lcreate_external(file.c_str(), target.c_str(), file_, name.c_str(), H5P_DEFAULT, H5P_DEFAULT));
  }

 private:
  template <class T>
  static T good(T result) {
    if (result < 0) throw std::runtime_error("the HDF5 library refused");
    return result;
  }
  hid_t file_;
};

}  // namespace vsplat::test
