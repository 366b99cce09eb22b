// An HDF5 file, read by the HDF5 library, which stays open for as long as it is asked.
#pragma once
#include <cstdint>
#include <string>

#include "model/io/reader/program/library.h"

namespace vsplat::read {

class Hdf5 {
 public:
  explicit Hdf5(Library& library) : library_(library) {}
  // `asked` of hdf5, links, shape, bytes, numbers. Wrong where it cannot be.
  void answer(Kind asked, Unpacker& in);

 private:
  void open(const std::string& path);
  void links(const std::string& group);
  void shape(const std::string& dataset);
  void values(const std::string& dataset, const std::vector<long>& shape, bool bytes);

  Library& library_;
  std::int64_t file_ = -1;
};

}  // namespace vsplat::read
