// An HDF5 file that stays open and answers queries, read with the HDF5 library.
#pragma once
#include <cstdint>
#include <string>

#include "model/io/reader/program/library.h"

namespace vsplat::read {

class Hdf5 {
 public:
  explicit Hdf5(Library& library) : library_(library) {}
  // Answers a request of kind hdf5, links, shape, bytes or numbers. Throws Wrong if it cannot.
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
