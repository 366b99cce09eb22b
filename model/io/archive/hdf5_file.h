// HDF5 files, read: names, shapes, whole data sets of numbers. Errors name the file and the place in it. The HDF5
// library is in another process (model/io/reader/README.md), one for each file that is open.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace vsplat {

// One thread at a time.
class Hdf5File {
 public:
  // Error(file) where there is no such file, Error(format) where it is not HDF5 or damaged.
  explicit Hdf5File(const std::string& path);
  ~Hdf5File();
  Hdf5File(const Hdf5File&) = delete;
  Hdf5File& operator=(const Hdf5File&) = delete;

  struct Link {
    std::string name;
    std::string external;  // the file it leads to, as an absolute or this file's relative path; "": it is in this one
  };
  // What a group ("/" for the file) holds, by name. Error(format) where it is no group.
  std::vector<Link> links(const std::string& group) const;

  // Sides of a data set. Error(format) where it is not there, or no array. More than eight sides are refused.
  std::vector<long> shape(const std::string& dataset) const;

  // All of it, converted. Error(format) where it cannot be read, has another shape than expected, or is of another
  // kind: bytes() takes unsigned integers of 8 bits alone, numbers() integers and floats.
  std::vector<std::uint8_t> bytes(const std::string& dataset, const std::vector<long>& shape) const;
  std::vector<double> numbers(const std::string& dataset, const std::vector<long>& shape) const;

 private:
  struct Session;
  class Idle;
  std::unique_ptr<Session> session_;
};

// "512 x 512 x 4"
std::string shape_text(const std::vector<long>& shape);

}  // namespace vsplat
