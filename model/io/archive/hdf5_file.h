// Reads HDF5 files: names, shapes and complete numeric data sets. Errors name the file and the position in it. The HDF5
// library runs in a separate process (model/io/reader/README.md), one for each open file.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace vsplat {

// Not thread-safe.
class Hdf5File {
 public:
  // Error(file) if the file does not exist, Error(format) if it is damaged or not HDF5.
  explicit Hdf5File(const std::string& path);
  ~Hdf5File();
  Hdf5File(const Hdf5File&) = delete;
  Hdf5File& operator=(const Hdf5File&) = delete;

  struct Link {
    std::string name;
    std::string external;  // the target file, as an absolute path or relative to this file; "" for an object in this
                           // file
  };
  // The members of a group ("/" for the root), by name. Error(format) if it is no group.
  std::vector<Link> links(const std::string& group) const;

  // The sides of a data set. Error(format) if it does not exist, is no array or has more than eight sides.
  std::vector<long> shape(const std::string& dataset) const;

  // All values, converted. Error(format) if they cannot be read, have another shape than `shape` or another type:
  // bytes() accepts only 8-bit unsigned integers, numbers() integers and floats.
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
